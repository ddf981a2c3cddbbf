"""A built wheel, installed somewhere else, is all that a stranger needs: commands, page, guard and missions."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
import tomllib
from importlib.metadata import version
from pathlib import Path
from venv import create
from zipfile import ZipFile

import pytest

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ("companion", "sitl", "missions", "pyproject.toml", "README.md", "LICENSE")
LEAST = 77
"""The version of setuptools that pyproject.toml asks for."""


def can_build() -> bool:
    return int(version("setuptools").split(".")[0]) >= LEAST


@pytest.mark.thorough
@pytest.mark.slow
@pytest.mark.skipif(not can_build(), reason=f"setuptools is older than {LEAST}")
def test_a_wheel_installs_and_drives(tmp_path: Path) -> None:
    source, place = tmp_path / "source", tmp_path / "there"
    for name in SOURCES:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(ROOT / name, source / name)
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet"]
    build = [*pip, "wheel", "--no-deps", "--no-build-isolation", "--no-index", "--wheel-dir", tmp_path, source]
    subprocess.run(build, check=True, timeout=300)
    (wheel,) = tmp_path.glob("*.whl")
    with ZipFile(wheel) as packed:
        names = set(packed.namelist())
    assert {"companion/vehicle/guard.lua", "companion/viewer/page/index.html", "companion/py.typed"} <= names
    assert not any("tests" in name.split("/")[:1] for name in names)
    # An environment of its own: pip would take the program that is under test out of this one.
    create(place, with_pip=False)
    python = place / "bin" / "python"
    install = [*pip, "--python", python, "install", "--no-deps", "--no-index", wheel]
    subprocess.run(install, check=True, timeout=300)
    ours = sysconfig.get_path("purelib", vars={"base": str(place), "platbase": str(place)})
    # What it needs is that of this environment; what the wheel brings comes before it.
    (Path(ours) / "needs.pth").write_text(f"{sysconfig.get_path('purelib')}\n", encoding="utf-8")
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}

    def said(script: str, *words: str) -> str:
        command = [place / "bin" / script, *words]
        done = subprocess.run(
            command, env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    told = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    assert said("rover-companion", "--version") == f"rover-companion {told}\n"
    listed = said("rover-sitl", "missions")
    assert listed.startswith(f"in {place / 'share' / 'rover-companion' / 'missions'}:")
    maps = "from sitl.experiments.experiment import load_maps; print(*load_maps(None, ('rooms', 'clutter')))"
    assert said("python", "-c", maps) == "rooms clutter\n"
    mission = place / "share" / "rover-companion" / "missions" / "first-drive" / "five-metres.toml"
    assert "outcome: reached" in said("rover-sitl", "drive", str(mission))
