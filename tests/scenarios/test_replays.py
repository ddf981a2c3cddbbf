"""Recorded runs are replayed without a difference, whatever happened in the run."""

from __future__ import annotations

import json
import shlex
import shutil
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image
from typer.testing import CliRunner

from companion.app import Companion
from companion.cli import replay as replay_command
from companion.cli.commands import app
from companion.cli.images import CHEAP_COLOUR, FREE_COLOUR, START_COLOUR, TAKEN_COLOUR, UNSEEN_COLOUR
from companion.core.tick_marks import Mark
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mavlink.codec import Codec
from companion.mavlink.transport import MemoryLink
from companion.mission.load import load_mission
from companion.mission.mission import Mission
from companion.navigation.field_step import Decision, NavState
from companion.navigation.step_runner import InlineRunner, StepCall
from companion.recording.reader import Record, load_record
from companion.recording.record_format import CHECKED_TICK, packed_tick, run_sum, unpacked_ticks
from companion.recording.recorder import Recorder
from companion.replay.replay import replay
from sitl.cli.commands import app as sitl_app
from tests.support.quick import first_of
from tests.support.records import recorded, unclosed, with_meta
from tests.support.rig import Rig, kept_in, yard
from tests.support.served import finished, process

MISSIONS = Path(__file__).resolve().parents[2] / "missions"
FILES = ("link.tlog", "rounds.bin", "decisions.jsonl")


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("yard")
    path = recorded(folder / "record", yard(folder))
    for name in ("yard.toml", "yard.png"):
        (folder / name).unlink()  # a record needs nothing beside itself
    return path


@pytest.fixture
def copy(record: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(record, tmp_path / "copy"))


def assert_same(record: Path) -> Record:
    loaded = load_record(record)
    result = replay(loaded)
    assert result.differences == []
    assert result.heard > 100 and result.said > 10
    return loaded


NO_SOCKETS = """
import sys
def hook(event, arguments):
    if event.startswith("socket.") and event != "socket.gethostname":
        raise SystemExit(f"{event} {arguments}")
sys.addaudithook(hook)
"""


@pytest.mark.thorough
def test_nothing_differs_in_another_process_which_opens_no_socket(record: Path) -> None:
    with process("companion", "replay", record, first=NO_SOCKETS) as child:
        code, out, err = finished(child)
    assert (code, err) == (0, "")
    assert out.startswith("gate: reached\n") and out.endswith("differences: none\n")


@pytest.mark.parametrize(
    ("name", "faults", "limit_s"),
    [
        ("crossing.toml", "radio", 60.0),
        pytest.param("ackermann.toml", "interrupted", 75.0, marks=pytest.mark.thorough),
        pytest.param("field.plan", "gps", 65.0, marks=pytest.mark.thorough),
        pytest.param("clutter.toml", "vehicle", 60.0, marks=pytest.mark.thorough),
    ],
)
def test_nothing_differs_under_faults(tmp_path: Path, name: str, faults: str, limit_s: float) -> None:
    """Every plan of faults; point and arc control, lidars and beams, moving things, a plan of a ground station."""
    loaded = assert_same(recorded(tmp_path / "record", load_mission(MISSIONS / name), faults, limit_s))
    assert len(loaded.decisions) > 10 and loaded.notes == []


class LateRunner(InlineRunner):
    """An imitation of a thread: each answer comes later than the one before."""

    def __init__(self) -> None:
        super().__init__()
        self._asked = self._count = 0

    def start(self, call: StepCall) -> None:
        self._asked, self._count = 0, self._count + 1
        super().start(call)

    def take(self) -> tuple[NavState, Decision] | None:
        self._asked += 1 if self.busy else 0
        return super().take() if self._asked > self._count % 7 else None


class Recorded(Rig):
    """A run of the rig with a record and answers that come late."""

    def __init__(self, folder: Path, mission: Mission) -> None:
        self.place = folder / "record"
        super().__init__(mission, state=folder / "state")

    def restart_companion(self, mission: Mission, *, resume: bool = False) -> None:
        assert self._state is not None
        checkpointer = kept_in(self._state, mission, resume=resume)
        files = {"state": self.state_file if resume else None}
        self.recorder = Recorder(self.place, mission, self.settings, 0, arm=True, files=files)
        near, self._far = MemoryLink.pair()
        self.link = AutopilotLink(near, Codec(self.settings.link), self.settings.link, self.recorder)
        self.companion = Companion(
            self.link,
            self,
            mission,
            self.settings,
            LateRunner(),
            self.recorder,
            seed=0,
            arm=True,
            checkpointer=checkpointer,
        )


@pytest.mark.thorough
def test_answers_of_a_thread_are_handed_over_when_the_run_had_them(tmp_path: Path) -> None:
    rig = Recorded(tmp_path, yard(tmp_path))
    rig.finish()
    rig.recorder.close()
    assert_same(rig.place)
    # Without the marks of the answers no decision is made: they are what tells when.
    ticks, _ = unpacked_ticks((rig.place / "rounds.bin").read_bytes())
    assert sum(bool(entry.marks & Mark.ANSWER) for entry in ticks) > 5
    unmarked = b"".join(packed_tick(entry._replace(marks=entry.marks & ~Mark.ANSWER)) for entry in ticks)
    (rig.place / "rounds.bin").write_bytes(unmarked)
    unclosed(rig.place)
    result = replay(load_record(rig.place))
    assert result.decisions <= 1, "nothing but: we are there"
    assert any("recorded decisions are missing" in line for line in result.differences)


@pytest.mark.thorough
def test_a_run_that_took_up_another_is_replayed_from_the_copy_of_its_state(tmp_path: Path) -> None:
    mission = yard(tmp_path)
    rig = Recorded(tmp_path, mission)
    rig.until_driven(6.0)
    rig.recorder.close()
    rig.restart_companion(mission, resume=True)
    rig.finish()
    rig.recorder.close()
    shutil.rmtree(tmp_path / "state")
    assert rig.recorder.directory.name == "record-2"
    assert_same(rig.place)
    loaded = assert_same(rig.recorder.directory)
    assert json.loads(loaded.decisions[0])["path"][0][0] > 4, "it went on where it was"


def test_a_run_that_could_not_save_its_state_is_replayed(tmp_path: Path) -> None:
    rig = Recorded(tmp_path, yard(tmp_path))
    rig.until_driven(1.0)
    shutil.rmtree(tmp_path / "state")
    rig.until_driven(3.0)
    rig.companion.stop()
    rig.finish()
    rig.recorder.close()
    assert any("The state cannot be saved" in text for text in rig.texts())
    assert_same(rig.place)


@first_of(1, "way_out", ["stop", "error"])
def test_the_way_out_is_replayed_too(tmp_path: Path, way_out: str, monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Recorded(tmp_path, yard(tmp_path))
    rig.until_driven(2.0)
    if way_out == "stop":
        rig.companion.stop()
        rig.finish()
    else:
        rig.companion.close()
    rig.recorder.close()
    result = replay(load_record(rig.place))
    wanted = [] if way_out == "stop" else ["the run was broken off by an error that the replay does not have"]
    assert [line.partition(": ")[2] for line in result.differences] == wanted
    assert result.companion is not None and result.companion.done


@pytest.mark.thorough
def test_a_run_that_was_otherwise_differs(copy: Path) -> None:
    meta = json.loads((copy / "meta.json").read_text())
    with_meta("arm", False)(copy)
    with_meta("run_sha256", run_sum(meta["seed"], meta["settings_sha256"], arm=False))(copy)
    result = CliRunner().invoke(app, ["replay", str(copy)])
    assert result.exit_code == 1
    assert "COMMAND_LONG 400" in result.output and "... and " in result.output
    assert "differences: none" not in result.output


def test_a_record_that_cannot_be_replayed_is_exit_code_2_and_one_line(copy: Path) -> None:
    (copy / "rounds.bin").unlink()
    result = CliRunner().invoke(app, ["replay", str(copy)])
    assert result.exit_code == 2
    assert len(result.output.strip().splitlines()) == 1 and str(copy / "rounds.bin") in result.output


@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_record_that_is_cut_anywhere_is_replayed_as_far_as_it_goes(
    record: Path, tmp_path: Path, data: st.DataObject
) -> None:
    copy = tmp_path / "cut"
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(record, copy)
    if data.draw(st.booleans(), "killed"):
        unclosed(copy)
    lengths = {}
    for name in FILES:
        size = (copy / name).stat().st_size
        lengths[name] = data.draw(st.integers(CHECKED_TICK.size if name == "rounds.bin" else 0, size - 1), name)
        with (copy / name).open("r+b") as file:
            file.truncate(lengths[name])
    loaded = load_record(copy)
    result = replay(loaded)
    assert result.differences == []
    assert loaded.notes and all("\n" not in note for note in loaded.notes)
    assert result.ticks <= lengths["rounds.bin"] // CHECKED_TICK.size


@pytest.mark.thorough
def test_a_decision_that_a_cut_record_does_not_reach_is_not_explained(record: Path, tmp_path: Path) -> None:
    copy = tmp_path / "cut"
    shutil.copytree(record, copy)
    with (copy / "link.tlog").open("r+b") as file:
        file.truncate((copy / "link.tlog").stat().st_size // 2)
    last = str(len(load_record(record).decisions))
    result = CliRunner().invoke(app, ["replay", str(copy), "--why", last])
    assert result.exit_code == 2 and f"ends before decision {last}" in result.output


@pytest.mark.thorough
def test_why_a_decision_was_made_is_shown(record: Path, copy: Path, tmp_path: Path) -> None:
    lines = load_record(record).decisions
    number = 1 + next(i for i, line in enumerate(lines) if i and json.loads(line)["searches"])
    picture = tmp_path / "why.png"
    result = CliRunner().invoke(app, ["replay", str(record), "--why", str(number), "--image", str(picture)])
    assert result.exit_code == 0, result.output
    decision = json.loads(lines[number - 1])
    assert result.output.startswith(f"decision {number} at {decision['time_s']:.2f} s, heading for gate")
    for words in (decision["reason"], "what is left of the current path", "search by hybrid", "proposed by", "taken: "):
        assert words in result.output
    with Image.open(picture) as image:
        assert image.width >= 900
        colours = {colour for _, colour in image.convert("RGB").getcolors(1 << 20) or []}
    assert {(214, 60, 50), (40, 110, 200), (150, 120, 90), FREE_COLOUR} <= colours
    (command,) = (line for line in result.output.splitlines() if line.startswith("to plan it again: "))
    name, *words = shlex.split(command.removeprefix("to plan it again: "))
    again = CliRunner().invoke(app, [*words, "--json"])
    assert name == "rover-companion" and again.exit_code == 0, again.output
    assert json.loads(again.stdout)["path"][-1] == [int(word) for word in words[words.index("--target") + 1].split(",")]
    (copy / f"why-{number}.png").mkdir()
    without = CliRunner().invoke(app, ["replay", str(copy), "--why", str(number)])
    assert without.exit_code == 0 and without.stdout.startswith(f"decision {number} at ")
    assert "no picture: " in without.stderr and "with --image" in without.stderr and "picture: " not in without.stdout
    late = CliRunner().invoke(app, ["replay", str(record), "--why", "100000"])
    assert late.exit_code == 2 and "the last one is" in late.output


@pytest.mark.thorough
def test_decisions_are_listed_so_that_one_can_be_chosen(copy: Path) -> None:
    contact = {"time_s": 55.0, "north_m": 0.0, "east_m": 4.0, "speed_m_s": 0.5, "with": "a post"}
    (copy / "collisions.json").write_text(json.dumps([contact]))
    result = CliRunner().invoke(app, ["replay", str(copy), "--list"])
    assert result.exit_code == 0, result.output
    lines = result.output.splitlines()
    assert "UTC" in lines[0] and "2027-01-15 07:59:59.950Z" in lines[0], "the first packet comes a tick later"
    assert lines[1].split()[:3] == ["no.", "time", "of"]
    made = [json.loads(line) for line in load_record(copy).decisions]
    rows = [line.split() for line in lines if line[:5].strip().isdigit()]
    assert [int(row[0]) for row in rows] == list(range(1, len(made) + 1))
    assert [float(row[2]) for row in rows] == [pytest.approx(one["time_s"], abs=0.006) for one in made]
    assert all(one["reason"] in line for one, line in zip(made, (" ".join(row) for row in rows), strict=True))
    assert any("hybrid searched (thorough)" in line for line in lines)
    at_s = [float(line[18:28]) for line in lines if line[7:9] == "08"]
    assert at_s == sorted(at_s)
    assert sum("contact with a post at 0.5 m/s" in line for line in lines) == 1
    assert any(line.endswith("- Reached gate") for line in lines) and lines[-2] == "differences: none"


@first_of(1, "which", ["time of day", "seconds"])
def test_why_takes_a_moment_of_the_list_and_shows_the_decision_in_force(
    record: Path, tmp_path: Path, which: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without its picture, which takes seconds."""
    monkeypatch.setattr(replay_command, "save_decision", lambda image, _: image.touch())
    listed = CliRunner().invoke(app, ["replay", str(record), "--list"]).output.splitlines()
    number, of_day, after_s = next(line.split()[:3] for line in listed if line.split()[:1] == ["7"])
    moment, image = of_day if which == "time of day" else f"{after_s}s", tmp_path / "why.png"
    result = CliRunner().invoke(app, ["replay", str(record), "--why", moment, "--image", str(image)])
    assert result.exit_code == 0 and result.output.startswith(f"decision {number} at {after_s} s")
    assert "taken: " in result.output and image.exists()


@first_of(
    2,
    ("options", "says"),
    [
        (["--why", "0"], "there is no decision 0, the last one is"),
        (
            ["--why", "14:99"],
            "give the number of a decision (66), the time since the start (83.5s or 1:23) or a time of day",
        ),
        (["--why", "9999s"], "it lasts"),
        (["--why", "23:00:00"], "--list shows all decisions"),
        (["--why", "1s"], "no decision had been made at 1s: the first was made after"),
        (["--why", "1", "--list"], "--list and --why do not go together"),
        (["--image", "x.png"], "--image goes with --why"),
    ],
)
def test_a_moment_that_is_none_is_one_line(record: Path, options: list[str], says: str) -> None:
    result = CliRunner().invoke(app, ["replay", str(record), *options])
    assert result.exit_code == 2 and says in result.output and len(result.output.splitlines()) == 1


def test_why_shows_the_motions_that_were_judged(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text('[guidance]\ncontroller = "motion-ga"\n')
    command = ["drive", str(MISSIONS / "one-obstacle.toml"), "--settings", str(tmp_path / "s.toml"), "--seed", "2"]
    CliRunner().invoke(sitl_app, [*command, "--time-limit-s", "50", "--record", str(tmp_path / "r")])
    number = len(load_record(tmp_path / "r").decisions) // 2
    result = CliRunner().invoke(app, ["replay", str(tmp_path / "r"), "--why", str(number)])
    assert result.exit_code == 0, result.output
    judged = result.output.partition("motions: ")[2].splitlines()
    assert judged[0].startswith("64 judged, 2.5 s long")
    costs = [float(line.partition("cost ")[2].partition(" s")[0]) for line in judged[1:6] if "cost " in line]
    assert costs and costs == sorted(costs)
    assert f"chosen: cost {costs[0]:.2f} s; the controller's command: " in result.output
    with Image.open(tmp_path / "r" / f"why-{number}-motions.png") as image:
        colours = {colour for _, colour in image.convert("RGB").getcolors(1 << 20) or []}
    assert {TAKEN_COLOUR, CHEAP_COLOUR, UNSEEN_COLOUR, START_COLOUR} <= colours


@pytest.mark.thorough
def test_why_tells_the_seconds_since_the_beginning(copy: Path) -> None:
    time_s = json.loads(load_record(copy).decisions[1])["time_s"]
    ticks, _ = unpacked_ticks((copy / "rounds.bin").read_bytes())
    later = b"".join(packed_tick(entry._replace(time_s=entry.time_s + 50000.0)) for entry in ticks)
    (copy / "rounds.bin").write_bytes(later)  # as on a computer that has run for half a day
    unclosed(copy)
    result = CliRunner().invoke(app, ["replay", str(copy), "--why", "2"])
    assert f"decision 2 at {time_s:.2f} s" in result.output


@pytest.mark.thorough
def test_drive_records_what_it_was_given(tmp_path: Path) -> None:
    given = ["--settings", str(tmp_path / "s.toml"), "--sensors", str(MISSIONS / "sensors" / "weathered.toml")]
    (tmp_path / "s.toml").write_text("[guidance]\nhorizon_m = 6.0\n")
    command = ["drive", str(MISSIONS / "depot.toml"), "--record", str(tmp_path / "r"), "--time-limit-s", "46", *given]
    assert CliRunner().invoke(sitl_app, command).exit_code == 3
    loaded = assert_same(tmp_path / "r")
    assert loaded.settings.guidance.horizon_m == 6.0
    assert {entry.name for entry in loaded.meta.inputs} >= {
        "inputs/mission/depot.toml",
        "inputs/mission/worlds/depot.toml",
        "inputs/settings/s.toml",
        "inputs/sensors/weathered.toml",
        "mission.json",
    }
    assert (loaded.input("settings") or tmp_path).name == "s.toml"
