"""Where compiled kernels are kept: beside the sources of a working copy, else in a directory of their own for every version."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from companion.cli.entry import start, unsuitable
from companion.cli.kernels import VARIABLE, choose_place

PACKAGE = Path(__file__).resolve().parents[3] / "companion"


def installed(folder: Path, text: str = "x = 1\n", *, working_copy: bool = False) -> Path:
    package = folder / "site" / "companion"
    (package / "planning").mkdir(parents=True, exist_ok=True)
    (package / "planning" / "kernel.py").write_text(text)
    if working_copy:
        (package.parent / "pyproject.toml").touch()
    return package


def test_who_has_chosen_a_place_keeps_it(tmp_path: Path) -> None:
    environment = {VARIABLE: "/my/own", "HOME": str(tmp_path)}
    assert choose_place(environment, (installed(tmp_path),)) == Path("/my/own")
    assert environment[VARIABLE] == "/my/own"


def test_a_working_copy_keeps_its_kernels_beside_the_sources(tmp_path: Path) -> None:
    environment = {"HOME": str(tmp_path)}
    assert choose_place(environment, (installed(tmp_path, working_copy=True),)) is None
    assert VARIABLE not in environment


@pytest.mark.parametrize(
    ("given", "base"),
    [
        ({"CACHE_DIRECTORY": "{}/cache:{}/other", "HOME": "{}"}, "cache"),
        ({"STATE_DIRECTORY": "{}/state", "HOME": "{}"}, "state"),
        ({"XDG_CACHE_HOME": "{}/xdg", "HOME": "{}"}, "xdg/rover-companion"),
        ({"XDG_CACHE_HOME": "relative", "HOME": "{}"}, ".cache/rover-companion"),
        ({"CACHE_DIRECTORY": "{}/file", "HOME": "{}"}, ".cache/rover-companion"),
    ],
    ids=["service", "service with a state only", "xdg", "home", "what cannot be written is passed over"],
)
def test_what_is_installed_keeps_them_elsewhere(tmp_path: Path, given: dict[str, str], base: str) -> None:
    (tmp_path / "file").touch()
    environment = {key: value.replace("{}", str(tmp_path)) for key, value in given.items()}
    place = choose_place(environment, (installed(tmp_path),))
    assert place is not None and place.parent == tmp_path / base and place.is_dir()
    assert environment[VARIABLE] == str(place)


def test_nowhere_to_write_is_a_temporary_place(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    environment = {"HOME": str(tmp_path / "file")}
    place = choose_place(environment, (installed(tmp_path),))
    assert place is not None and place.is_dir() and environment[VARIABLE] == str(place)
    place.rmdir()


def test_every_version_has_kernels_of_its_own_and_old_ones_go(tmp_path: Path) -> None:
    places = []
    for number in range(4):
        environment = {"CACHE_DIRECTORY": str(tmp_path / "cache")}
        place = choose_place(environment, (installed(tmp_path, f"x = {number}\n"),))
        assert place is not None
        os.utime(place, (number, number))
        places.append(place)
    assert len(set(places)) == 4
    assert sorted((tmp_path / "cache").iterdir()) == sorted(places[2:])
    again = choose_place({"CACHE_DIRECTORY": str(tmp_path / "cache")}, (installed(tmp_path, "x = 3\n"),))
    assert again == places[3]


SCRIPT = """
import sys
from companion.cli.entry import start

def load():
    import numpy
    from companion.mapping.kernels import nearest
    def command(prog_name, standalone_mode):
        nearest(numpy.zeros((4, 4), numpy.float32), 1.0, 1.0, 1.0, 0.5)
        stats = nearest.stats
        print(stats.cache_path, sum(stats.cache_hits.values()), sum(stats.cache_misses.values()))
    return command

sys.exit(start("rover-companion", load))
"""


def test_a_package_that_cannot_be_written_is_compiled_once(tmp_path: Path) -> None:
    """As root without root's power to write everywhere, where these tests run as root; ``HOME`` leads nowhere, as that of a service may."""
    copied = ("__init__.py", "evidence.py", "reporting.py", "cli/__init__.py", "cli/entry.py", "cli/kernels.py")
    site = tmp_path / "site"
    for name in copied:
        target = site / "companion" / name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes((PACKAGE / name).read_bytes())
    for path in (site, *site.rglob("*")):
        path.chmod(0o555 if path.is_dir() else 0o444)
    powerless = (
        ["setpriv", "--bounding-set", "-dac_override", "--inh-caps", "-dac_override", "--"] if os.geteuid() == 0 else []
    )
    environment = {
        "PATH": os.environ["PATH"],
        "PYTHONPATH": str(site),
        "HOME": "/nowhere",
        "CACHE_DIRECTORY": str(tmp_path / "cache"),
    }
    told = []
    for _ in range(2):
        done = subprocess.run(
            [*powerless, sys.executable, "-c", SCRIPT],
            env=environment,
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        told.append(done.stdout.split())
    for path in (site, *site.rglob("*")):
        path.chmod(0o755)
    assert [words[1:] for words in told] == [["0", "1"], ["1", "0"]], "compiled the first time, found the second time"
    assert told[0][0].startswith(str(tmp_path / "cache" / "kernels-"))


def test_a_32_bit_system_gets_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert unsuitable(2**63 - 1) == ""
    monkeypatch.setattr(sys, "maxsize", 2**31 - 1)
    assert start("rover-companion", lambda: pytest.fail("nothing is loaded")) == 2
    assert capsys.readouterr().err.count("\n") == 1 and "64-bit" in unsuitable(2**31 - 1)
