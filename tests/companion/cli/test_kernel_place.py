"""The cache of compiled kernels: its place, and what makes a kernel invalid."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from companion.cli import kernel_cache
from companion.cli.entry import start, unsuitable

PACKAGE = Path(kernel_cache.__file__).parents[1]


def test_the_users_choice_of_a_place_counts(tmp_path: Path) -> None:
    environment = {kernel_cache.PLACE: "/my/own", "HOME": str(tmp_path)}
    assert kernel_cache.use_cache(environment) == Path("/my/own")
    assert environment[kernel_cache.PLACE] == "/my/own"


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
def test_the_place_is_the_first_that_can_be_written(tmp_path: Path, given: dict[str, str], base: str) -> None:
    (tmp_path / "file").touch()
    environment = {key: value.replace("{}", str(tmp_path)) for key, value in given.items()}
    place = kernel_cache.use_cache(environment)
    assert place == tmp_path / base / "kernels" and place.is_dir()
    assert environment[kernel_cache.PLACE] == str(place)


@pytest.mark.parametrize("shared", ["", "open to others", "a link"])
def test_nowhere_to_write_is_a_temporary_place_that_the_next_start_finds_if_it_is_the_users_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shared: str
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    own = tmp_path / f"rover-companion-kernels-{os.getuid()}"
    if shared == "open to others":
        own.mkdir()
        own.chmod(0o770)
    elif shared:
        (tmp_path / "elsewhere").mkdir(mode=0o700)
        own.symlink_to(tmp_path / "elsewhere")
    places = []
    for _ in range(2):
        environment = {"HOME": str(tmp_path / "file")}
        places.append(kernel_cache.use_cache(environment))
        assert places[-1].is_dir() and environment[kernel_cache.PLACE] == str(places[-1])
        assert places[-1].stat().st_mode & 0o077 == 0
    assert (own in places) == (not shared) and (places[0] == places[1]) == (not shared)


MODULES = {
    "limits.py": "FACTOR = 2.0\nUNUSED = 1.0\nclass Box:\n    pass\n",
    "inner.py": """
from numba import njit
from companion.limits import FACTOR
from companion.unrelated import WORD

@njit(cache=True)
def scaled(value):
    return FACTOR * value

def told():
    return WORD
""",
    "outer.py": """
from numba import njit
from companion import inner

@njit(cache=True)
def both(value):
    return inner.scaled(value) + 1.0
""",
    "other.py": "from numba import njit\n\n@njit(cache=True)\ndef other(value):\n    return value\n",
    "unrelated.py": "WORD = 'one'\n",
}
SCRIPT = """
import json, sys
from companion.cli.entry import start

def load():
    from companion.inner import scaled
    from companion.other import other
    from companion.outer import both
    def command(prog_name, standalone_mode):
        both(3.0), other(3.0)
        compiled = [k.__name__ for k in (scaled, both, other) if sum(k.stats.cache_misses.values())]
        print(json.dumps([both(3.0), compiled]))
    return command

sys.exit(start("rover-companion", load))
"""


class Program:
    """A small program with kernels in three files, and a cache; it starts with the project's own entry point."""

    def __init__(self, folder: Path, cache: Path) -> None:
        self.folder, self._cache = folder, cache
        for name in ("__init__.py", "cli/__init__.py", "cli/entry.py", "cli/kernel_cache.py", "cli/source_names.py"):
            (folder / "companion" / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(PACKAGE / name, folder / "companion" / name)
        for name, text in MODULES.items():
            (folder / "companion" / name).write_text(text)

    def edit(self, name: str, old: str, new: str) -> None:
        path = self.folder / "companion" / name
        path.write_text(path.read_text().replace(old, new))

    def run(self, *before: str) -> tuple[float, list[str]]:
        """What the outer kernel gives, and the kernels that had to be compiled."""
        environment = {
            "PATH": os.environ["PATH"],
            "PYTHONPATH": str(self.folder),
            "PYTHONDONTWRITEBYTECODE": "1",
            "HOME": "/nowhere",
            "CACHE_DIRECTORY": str(self._cache),
        }
        command = [*before, sys.executable, "-c", SCRIPT]
        options = {"env": environment, "cwd": self._cache.parent, "capture_output": True, "text": True, "timeout": 300}
        done = subprocess.run(command, check=False, **options)
        assert done.returncode == 0, done.stderr
        value, compiled = json.loads(done.stdout)
        return value, compiled


@pytest.mark.thorough
def test_a_kernel_is_compiled_again_only_when_something_it_uses_has_changed(tmp_path: Path) -> None:
    program = Program(tmp_path / "one", tmp_path / "cache")
    assert program.run() == (7.0, ["scaled", "both", "other"])

    copy = Program(tmp_path / "two", tmp_path / "cache")
    for path in copy.folder.rglob("*.py"):
        os.utime(path, (1.0, 1.0))
    copy.edit("unrelated.py", "one", "two")
    assert copy.run() == (7.0, []), "another folder, other times, and a file whose names no kernel uses"

    program.edit("limits.py", "2.0", "5.0")
    assert program.run() == (16.0, ["scaled", "both"]), "a constant, two files away"
    program.edit("limits.py", "5.0", "2.0")
    program.edit("inner.py", "* value", "* value * value")
    assert program.run() == (19.0, ["scaled", "both"]), "a kernel that it calls"
    program.edit("inner.py", "* value * value", "* value")
    assert program.run() == (7.0, []), "as it was: still kept"


@pytest.mark.thorough
def test_a_package_that_cannot_be_written_is_compiled_once(tmp_path: Path) -> None:
    """If these tests run as root, the program lacks root's right to write everywhere; ``HOME`` does not exist."""
    program = Program(tmp_path / "site", tmp_path / "cache")
    for path in (program.folder, *program.folder.rglob("*")):
        path.chmod(0o555 if path.is_dir() else 0o444)
    powerless = ["setpriv", "--bounding-set", "-dac_override", "--inh-caps", "-dac_override", "--"]
    runs = [program.run(*(powerless if os.geteuid() == 0 else [])) for _ in range(2)]
    for path in (program.folder, *program.folder.rglob("*")):
        path.chmod(0o755)
    assert runs == [(7.0, ["scaled", "both", "other"]), (7.0, [])]


def test_of_a_files_old_versions_some_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(kernel_cache.PLACE, str(tmp_path))
    for number in range(kernel_cache.KEPT + 2):
        old = tmp_path / f"companion.mapping.evidence_kernels-{number:016}"
        old.mkdir()
        os.utime(old, (number, number))
    other = tmp_path / "companion.mapping.arc_kernels-0000000000000000"
    other.mkdir()
    file = PACKAGE / "mapping" / "evidence_kernels.py"
    locator = kernel_cache.Locator.from_function(test_of_a_files_old_versions_some_are_kept, str(file))
    assert locator is not None and Path(locator.get_cache_path()).is_dir()
    left = sorted(path.name[-1] for path in tmp_path.glob("companion.mapping.evidence_kernels-0*"))
    assert left == ["3", "4", "5"] and other.is_dir()


@pytest.mark.thorough
def test_a_file_that_is_edited_while_the_program_loads_makes_no_kernel_for_others(tmp_path: Path) -> None:
    program = Program(tmp_path / "one", tmp_path / "cache")
    outer = program.folder / "companion" / "outer.py"
    editing = f"\nimport os\nos.utime({str(program.folder / 'companion' / 'inner.py')!r}, (1.0, 1.0))\n"
    outer.write_text(outer.read_text().replace("\n@njit", editing + "\n@njit"))
    assert program.run() == (7.0, ["scaled", "both", "other"])
    os.utime(program.folder / "companion" / "inner.py", (2.0, 2.0))
    assert program.run() == (7.0, ["both"])


def test_kernels_of_other_projects_are_left_to_numba() -> None:
    assert kernel_cache.Locator.from_function(json.dumps, json.__file__) is None


def test_a_32_bit_system_gets_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert unsuitable(2**63 - 1) == ""
    monkeypatch.setattr(sys, "maxsize", 2**31 - 1)
    assert start("rover-companion", lambda: pytest.fail("nothing is loaded")) == 2
    assert capsys.readouterr().err.count("\n") == 1 and "64-bit" in unsuitable(2**31 - 1)
