"""Files that cannot be used: a pipe, a folder, a file too large.

Every command says so in one line with a remedy, and never waits.
"""

from __future__ import annotations

import ast
import os
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from companion.checkpoint.state_directory import StateDirectory, StateDirectoryError
from companion.cli.commands import app as companion
from companion.cli.inputs import OutputError
from companion.cli.state import StateFiles
from companion.core.clock import WallClock
from companion.core.frames import GeoPoint, LocalFrame
from companion.mavlink.byte_link import LinkError
from companion.mavlink.serial_port import SerialLink
from companion.mavlink.signing import SigningKeyError, load_key
from companion.mission.load import load_mission
from companion.mission.mission import MissionError
from companion.mission.resolve import resolve
from companion.settings import SettingsError, load_settings
from sitl.cli.commands import app as sitl
from sitl.firmware.parameter_files import MOST_BYTES, ParameterFileError, load_parameters
from tests.support.rig import yard

NOBODY = ("--connect", "tcp:127.0.0.1:9")
PLAN = ("--start", "0,0", "--target", "1,1")
ROOT = Path(__file__).resolve().parents[3]
FREE = str(ROOT / "missions" / "maps" / "one-obstacle.png")
REASONS = ("not a file", "no grids", "a MovingAI scenario file beside it")
"""Where any file is looked for, a pipe is none."""
RUN = ("run", "yard.toml", *NOBODY)
ROS = "image: {pipe}\nresolution: 1.0\norigin: [0, 0, 0]\n"

COMPANION: dict[str, tuple[str, ...]] = {
    "m.toml": ("run", "{}", *NOBODY),
    "m.plan": ("mission", "check", "{}"),
    "m.waypoints": ("mission", "check", "{}"),
    "fence.plan": ("mission", "check", "fenced.toml"),
    "prior.png": ("mission", "check", "known.toml"),
    "s.toml": (*RUN, "--settings", "{}"),
    "d.toml": ("doctor", *NOBODY, "--settings", "{}"),
    "b.toml": ("bench", "--sizes", "1", "--settings", "{}"),
    "state/tuned.toml": (*RUN, "--state", "state"),
    "seen/tuned.toml": ("doctor", *NOBODY, "--state", "seen"),
    "old/mission.state": (*RUN, "--state", "old", "--resume"),
    "signed/signing-time": (*RUN, "--state", "signed", "--signing-key", "key"),
    "key-pipe": (*RUN, "--signing-key", "{}"),
    "record/link.tlog": (*RUN, "--record", "record"),
    "copies/inputs/mission/yard.toml": (*RUN, "--record", "copies"),
    "replayed/meta.json": ("replay", "replayed"),
    "map.png": ("plan", "{}", *PLAN),
    "map.pgm": ("plan", "{}", *PLAN),
    "map.bmp": ("plan", "{}", *PLAN),
    "map.map": ("plan", "{}", *PLAN),
    "map.yaml": ("plan", "{}", *PLAN),
    "ros.pgm": ("plan", "ros.yaml", *PLAN),
    "plan.png": ("plan", FREE, *PLAN, "--image", "{}"),
    "plan.toml": ("plan", FREE, *PLAN, "--settings", "{}"),
    "bench.map": ("bench", "{}", "--sizes", ""),
    "good.map.scen": ("bench", "good.map", "--sizes", ""),
    "bench.json": ("bench", "--sizes", "1", "--json", "{}"),
    "pages/benchmarks.md": ("bench", "--sizes", "1", "--docs", "pages"),
    "maps/one-obstacle.png": ("bench", "--sizes", "1", "--maps", "maps"),
}
SITL: dict[str, tuple[str, ...]] = {
    "mission.toml": ("drive", "{}"),
    "w.png": ("drive", "yard.toml", "--world", "{}"),
    "alone.png": ("drive", "--world", "{}", "--start", "1,1", "--target", "3,3"),
    "w.toml": ("drive", "yard.toml", "--world", "{}"),
    "w.yaml": ("drive", "yard.toml", "--world", "{}"),
    "w.map": ("drive", "yard.toml", "--world", "{}"),
    "base.png": ("drive", "yard.toml", "--world", "based.toml"),
    "settings.toml": ("drive", "yard.toml", "--settings", "{}"),
    "image.png": ("drive", "yard.toml", "--image", "{}"),
    "stem.yaml": ("drive", "yard.toml", "--map", "stem"),
    "drive.json": ("drive", "yard.toml", "--json", "{}"),
    "driven/rounds.bin": ("drive", "yard.toml", "--record", "driven"),
    "rover.param": ("drive", "yard.toml", "--params", "{}"),
    "faults.toml": ("drive", "yard.toml", "--faults", "{}"),
    "served.toml": ("serve", "{}"),
    "served.param": ("serve", "yard.toml", "--params", "{}"),
    "served-faults.toml": ("serve", "yard.toml", "--faults", "{}"),
    "firmware.param": ("physics", "yard.toml", "--params", "{}"),
    "out.param": ("physics", "yard.toml", "--write-params", "{}"),
    "kmaps/known-1.png": ("experiment", "kwasniewski-table1", "--runs", "3", "--maps", "kmaps"),
    "field.map": ("experiment", "navigation", "--runs", "1", "--world", "{}"),
    "runs.json": ("experiment", "navigation", "--runs", "1", "--json", "{}"),
    "results/results.md": ("experiment", "navigation", "--runs", "1", "--docs", "results"),
    "grids/one.txt": ("experiment", "sedighi-table1", "--runs", "1", "--maps", "grids"),
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """With files that name others, and nobody to connect to."""
    monkeypatch.chdir(tmp_path)
    yard(tmp_path)
    head = (tmp_path / "yard.toml").read_text()
    Path("fenced.toml").write_text('fence = "fence.plan"\n' + head)
    Path("known.toml").write_text('prior_map = "prior.png"\n' + head)
    Path("ros.yaml").write_text(ROS.format(pipe="ros.pgm"))
    Path("based.toml").write_text('base = "base.png"\n')
    Path("good.map").write_text("type octile\nheight 2\nwidth 2\nmap\n..\n..\n")
    Path("key").write_text("words\n")
    Path("key").chmod(0o600)
    return tmp_path


@pytest.mark.timeout(100)
@pytest.mark.parametrize("name", [*COMPANION, *SITL])
def test_every_command_refuses_a_pipe_in_one_line(folder: Path, name: str) -> None:
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    os.mkfifo(folder / name)
    app, command = (companion, COMPANION[name]) if name in COMPANION else (sitl, SITL[name])
    result = CliRunner().invoke(app, [word.format(name) for word in command])
    assert result.exit_code == 2
    assert len(result.stderr.splitlines()) == 1
    assert Path(name).stem in result.stderr or Path(name).parent.name in result.stderr
    assert any(words in result.stderr for words in REASONS)


def test_no_more_than_may_be_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "large"
    with path.open("wb") as file:
        file.truncate(3_000_000_000)
    monkeypatch.setattr(Path, "read_bytes", lambda _: pytest.fail("all of it has been read"))
    with pytest.raises(ParameterFileError, match=f"larger than {MOST_BYTES} bytes"):
        load_parameters(path)


def load_state(path: Path) -> None:
    StateDirectory(path.parent).load(load_mission(path.parent / "yard.toml"))


def test_a_folder_is_no_mission(tmp_path: Path) -> None:
    (tmp_path / "m.toml").mkdir()
    with pytest.raises(MissionError, match=r"m\.toml: is a folder, not a file; add a file's name"):
        load_mission(tmp_path / "m.toml")


@pytest.mark.parametrize("key", ["prior_map", "sitl.world"])
@pytest.mark.parametrize("what", ["folder", "pipe"])
def test_what_a_mission_names_and_is_no_file(tmp_path: Path, key: str, what: str) -> None:
    yard(tmp_path)
    (tmp_path / "map.png").mkdir() if what == "folder" else os.mkfifo(tmp_path / "map.png")
    mission = tmp_path / "yard.toml"
    text = mission.read_text()
    mission.write_text(text.replace("yard.png", "map.png") if key == "sitl.world" else f'prior_map = "map.png"\n{text}')
    with pytest.raises(MissionError, match=rf"{key}: .*map.png: .*not a file; \w") as caught:
        load_mission(mission)
    assert "no such file" not in str(caught.value)


@pytest.mark.parametrize("name", ["driving", "dead-companion"])
def test_an_experiment_names_the_folder_that_was_given(tmp_path: Path, name: str) -> None:
    for folder, reason in ((tmp_path / "none", "no such folder of maps"), (tmp_path, "open.toml does not lie beside")):
        result = CliRunner().invoke(sitl, ["experiment", name, "--runs", "1", "--maps", str(folder)])
        assert result.exit_code == 2 and result.stderr.startswith(f"{folder}: {reason}")
        assert "missions/maps of the source" in result.stderr and len(result.stderr.splitlines()) == 1


def far(folder: Path) -> None:
    mission = load_mission(Path(__file__).parents[3] / "missions" / "field.waypoints")
    lay = GeoPoint(0.0, 0.0)
    resolve(mission, LocalFrame(lay), LocalFrame(lay).to_ned(lay))


def state_is_a_folder(folder: Path) -> None:
    yard(folder)
    (folder / "mission.state").mkdir()
    load_state(folder / "mission.state")


def state_is_a_file(folder: Path) -> None:
    (folder / "file").touch()
    StateFiles(folder / "file")


REMEDIES: dict[str, tuple[Callable[[Path], object], str]] = {
    "a state that is a file": (state_is_a_file, "file: is a file; --state takes a directory"),
    "a state that is a folder": (state_is_a_folder, "Is a directory; remove it, or start without --resume"),
    "no serial port": (lambda folder: SerialLink("/etc/passwd", 57600, WallClock()), "it is no serial port; see `ls"),
    "a folder for a port": (
        lambda folder: SerialLink(str(folder), 57600, WallClock()),
        ": cannot be opened: it is a directory, no serial port; see `ls /dev/tty*`",
    ),
    "no key": (lambda folder: load_key(folder / "nokey"), "No such file or directory; name a file with the passphrase"),
    "settings in a folder": (load_settings, "Is a directory; name a TOML file, or leave --settings out"),
    "a mission that says no resolution": (far, "km from home; is that meant? Check the coordinates"),
}


@pytest.mark.parametrize("what", REMEDIES)
def test_what_cannot_be_used_is_told_with_a_remedy(tmp_path: Path, what: str) -> None:
    use, words = REMEDIES[what]
    with pytest.raises(
        (OutputError, StateDirectoryError, LinkError, SigningKeyError, SettingsError, MissionError)
    ) as caught:
        use(tmp_path)
    assert words in str(caught.value) and "\n" not in str(caught.value)


OPENERS = {"open", "read_text", "read_bytes"}
OPENED_OTHERWISE = {
    "companion/storage/files.py": "opens for all others",
    "companion/checkpoint/state_directory.py": "the lock: opened for reading and writing, a pipe is not waited for",
    "companion/recording/recorder.py": "writes, after refuse_pipe",
    "companion/cli/inputs.py": "writes, after refuse_pipe",
    "companion/mission/waypoints_reader.py": "storage/files.py's read_text",
    "companion/mission/plan_reader.py": "storage/files.py's read_text",
    "companion/mapping/map_files.py": "a picture that reading.py has opened",
    "companion/cli/kernel_cache.py": "the program's own files",
    "companion/cli/source_names.py": "the program's own files",
    "companion/lidar/serial_port.py": "a serial port, which a thread reads",
    "companion/vehicle/guard.py": "the program's own file",
    "companion/storage/unbuffered.py": "/dev/null",
    "companion/cli/entry.py": "/dev/null",
    "companion/bench/measure.py": "/proc",
    "sitl/experiments/dead_companion.py": "a pipe of its own",
    "sitl/experiments/soak.py": "/proc",
    "companion/cli/report.py": "a browser",
    "companion/viewer/report_csv.py": "written only",
    "companion/viewer/report_mcap.py": "written only",
    "companion/viewer/report_page.py": "the program's own files",
    "companion/viewer/server.py": "the program's own files",
    "sitl/experiments/experiment.py": "the program's own files",
    "sitl/scenario.py": "World.open",
    "companion/mavlink/port_users.py": "/proc",
    "sitl/cli/missions.py": "the program's own files",
    "sitl/cli/runs.py": "a folder, to lock it",
    "sitl/campaign/run_store.py": "written only, after refuse_pipe",
    "sitl/campaign/tables.py": "written only, after refuse_pipe",
    "sitl/campaign/runs_table.py": "the program's own files",
}


def test_every_file_is_opened_where_pipes_are_refused() -> None:
    opening = set()
    for path in (path for top in ("companion", "sitl") for path in (ROOT / top).rglob("*.py")):
        calls = [node.func for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call)]
        names = {call.id if isinstance(call, ast.Name) else getattr(call, "attr", "") for call in calls}
        if names & OPENERS:
            opening.add(path.relative_to(ROOT).as_posix())
    assert opening == OPENED_OTHERWISE.keys()
