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
from zipfile import ZipFile

import pytest

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ("companion", "sitl", "missions", "pyproject.toml", "README.md", "LICENSE")
LEAST = 77
"""The version of setuptools that pyproject.toml asks for."""


def can_build() -> bool:
    return int(version("setuptools").split(".")[0]) >= LEAST


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
    subprocess.run([*pip, "install", "--no-deps", "--no-index", "--prefix", place, wheel], check=True, timeout=300)
    packages = Path(sysconfig.get_path("purelib", vars={"base": str(place), "platbase": str(place)}))
    # The kernels of the sources serve: a kernel counts by its text. Then only what the wheel brings is missing.
    environment = {**os.environ, "PYTHONPATH": str(packages), "PYTHONSAFEPATH": "1"}

    def said(script: str, *words: str) -> str:
        command = [sys.executable, place / "bin" / script, *words]
        done = subprocess.run(
            command, env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    told = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    assert said("rover-companion", "--version") == f"rover-companion {told}\n"
    listed = said("rover-sitl", "missions")
    assert listed.startswith(f"in {place / 'share' / 'rover-companion' / 'missions'}:")
    mission = place / "share" / "rover-companion" / "missions" / "first-drive" / "five-metres.toml"
    assert "outcome: reached" in said("rover-sitl", "drive", str(mission))
