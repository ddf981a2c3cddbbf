"""Fault plans: what they say, when a fault is there, and the one line for what they get wrong."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from companion.mission.load import load_mission
from sitl.cli.commands import app
from sitl.faults.fault_file import FaultFileError, load_faults
from sitl.faults.plan import Fault, GpsGlitch, LinkEffect, LinkFault, PilotTakesOver, Reboot, SensorFault
from sitl.faults.tables import KINDS
from sitl.scenario import ScenarioError, scenario_from_mission, with_faults
from sitl.sensors.range_sensors import Defect
from tests.support.quick import examples

ROOT = Path(__file__).resolve().parents[3]
SHIPPED = sorted((ROOT / "missions" / "faults").glob("*.toml"))
LEAST = {
    "packet_loss": "probability = 0.5",
    "packet_delay": "delay_s = 0.5",
    "packet_reorder": "probability = 0.5",
    "packet_duplicate": "probability = 0.5",
    "packet_corrupt": "probability = 0.5",
    "pilot": 'mode = "HOLD"',
    "gps_glitch": "metres = 5.0",
    "gps_noise": "metres = 0.5",
    "gps_fix": 'fix = "3d"',
    "wheel_slip": "share = 0.5",
    "command": 'effect = "lost"',
    "lidar_loss": "probability = 0.01",
    "lidar_corrupt": "probability = 0.01",
    "lidar_noise": "metres = 0.05",
}


def plan_file(folder: Path, text: str) -> Path:
    path = folder / "plan.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_needs_little(kind: str, tmp_path: Path) -> None:
    text = f'[[fault]]\nkind = "{kind}"\nstart_s = 3\n{LEAST.get(kind, "")}\n'
    (fault,) = load_faults(plan_file(tmp_path, text)).faults
    assert fault.start_s == 3.0
    assert fault.end_s == (6.0 if isinstance(fault, Reboot) else math.inf)
    assert fault.since == "boot"


def test_what_is_said_is_understood(tmp_path: Path) -> None:
    text = """
    seed = 7
    [[fault]]
    kind = "packet_delay"
    start_s = 1.5
    end_s = 4.0
    repeat_s = 10.0
    delay_s = 0.2
    jitter_s = 0.1
    direction = "to_vehicle"
    links = [2, 3]
    [[fault]]
    kind = "gps_glitch"
    since = "driving"
    start_s = 5
    duration_s = 2
    metres = 10
    bearing_deg = 90
    [[fault]]
    kind = "pilot"
    start_s = 0
    mode = "MANUAL"
    steering = -0.5
    throttle = 0.25
    [[fault]]
    kind = "sensor_stuck"
    start_s = 0
    beams = [2]
    [[fault]]
    kind = "sensor_stuck"
    start_s = 0
    in_view = true
    """
    plan = load_faults(plan_file(tmp_path, text))
    assert plan.seed == 7
    assert plan.faults == (
        LinkFault(1.5, 4.0, "boot", 10.0, LinkEffect.DELAY, 1.0, 0.2, 0.1, "to_vehicle", (2, 3)),
        GpsGlitch(5.0, 7.0, "driving", metres=10.0, bearing_deg=90.0),
        PilotTakesOver(0.0, mode="MANUAL", steering=-0.5, throttle=0.25),
        SensorFault(0.0, defect=Defect.STUCK, beams=(2,)),
        SensorFault(0.0, defect=Defect.STUCK_IN_VIEW),
    )


BAD = [
    ("", "fault: there is none; write"),
    ("fault = 3\n", "fault: must be a list in [brackets]"),
    ("[[faults]]\n", "faults: unknown key, did you mean 'fault'?"),
    ('[[fault]]\nkind = "packet_los"\nstart_s = 1\n', "unknown kind 'packet_los', did you mean 'packet_loss'?"),
    ("[[fault]]\nstart_s = 1\n", "fault 1: kind: missing; kinds are packet_loss, "),
    ('[[fault]]\nkind = "gps_loss"\n', "fault 1 (gps_loss): start_s: is missing"),
    (
        '[[fault]]\nkind = "gps_loss"\nstart_s = 1\n[[fault]]\nkind = "packet_loss"\nstart_s = 1\n',
        "fault 2 (packet_loss)",
    ),
    ('[[fault]]\nkind = "packet_loss"\nstart_s = 1\nprobability = 1.5\n', "must be 1 or less"),
    ('[[fault]]\nkind = "packet_loss"\nstart_s = 1\nprobability = nan\n', "probability"),
    ('[[fault]]\nkind = "gps_noise"\nstart_s = 1\nmetres = 1\ntime = 3\n', "unknown key, did you mean 'time_s'?"),
    ('[[fault]]\nkind = "gps_loss"\nstart_s = -1\n', "must be 0 or more"),
    ('[[fault]]\nkind = "gps_loss"\nstart_s = "soon"\n', "must be a number"),
    ('[[fault]]\nkind = "gps_loss"\nstart_s = 5\nend_s = 5\n', "end_s 5 is not after start_s 5; choose a later end_s"),
    ('[[fault]]\nkind = "gps_loss"\nstart_s = 5\nend_s = 9\nduration_s = 4\n', "use one of them"),
    ('[[fault]]\nkind = "gps_loss"\nstart_s = 5\nduration_s = 4\nrepeat_s = 4\n', "repeat_s must be longer"),
    ('[[fault]]\nkind = "gps_loss"\nstart_s = 5\nrepeat_s = 4\n', "repeat_s must be longer"),
    ('[[fault]]\nkind = "pilot"\nstart_s = 5\nmode = "HOVER"\n', "unknown mode 'HOVER'; modes are MANUAL, "),
    ('[[fault]]\nkind = "pilot"\nstart_s = 5\nmode = "HOLD"\nthrottle = 1\n', 'use mode = "MANUAL" or leave them out'),
    ('[[fault]]\nkind = "packet_loss"\nstart_s = 1\nprobability = 1\nlinks = [0]\n', "links.0"),
    (
        "seed = -1\n[[fault]]\nkind = 'gps_loss'\nstart_s = 1\n",
        "seed: must be 0 or more (got -1); docs/",
    ),
    ("[[fault]\n", "not valid TOML"),
]


@pytest.mark.parametrize(("text", "words"), BAD, ids=range(len(BAD)))
def test_a_bad_plan_gets_one_line(text: str, words: str, tmp_path: Path) -> None:
    path = plan_file(tmp_path, text)
    for command in ("drive", "serve"):
        result = CliRunner().invoke(app, [command, str(ROOT / "missions" / "open.toml"), "--faults", str(path)])
        assert result.exit_code == 2
        assert len(result.output.strip().splitlines()) == 1
        assert result.output.startswith(f"{path}: ")
        assert words in result.output
        assert ";" in result.output, "what to do about it is missing"


@pytest.mark.parametrize("content", [None, b"\xff\xfe", b"x" * 1_000_001, b"a = " + b"[" * 5000])
def test_a_file_that_is_no_plan_gets_one_line(content: bytes | None, tmp_path: Path) -> None:
    path = tmp_path / "plan.toml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(FaultFileError) as caught:
        load_faults(path)
    assert re.fullmatch(rf"{re.escape(str(path))}: .+; .+", str(caught.value))


@settings(max_examples=examples(50))
@given(text=st.text(max_size=100))
def test_any_text_is_read_or_refused(text: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.getbasetemp() / "any.toml"
    path.write_text(text, encoding="utf-8", newline="")
    try:
        load_faults(path)
    except FaultFileError as error:
        assert "\n" not in str(error)


def test_a_beam_that_is_not_there_is_refused(tmp_path: Path) -> None:
    plan = load_faults(plan_file(tmp_path, '[[fault]]\nkind = "sensor_silent"\nstart_s = 1\nbeams = [1]\n'))
    with pytest.raises(ScenarioError, match=r"fault 1: beams 1: the sensors lidar-\d+ have 0 beams; leave beams out"):
        with_faults(scenario_from_mission(load_mission(ROOT / "missions" / "open.toml")), plan)


def test_there_are_shipped_plans() -> None:
    assert len(SHIPPED) >= 4


def test_the_shipped_plans_show_every_kind() -> None:
    kinds = {kind for path in SHIPPED for kind in re.findall(r'^kind = "(\w+)"', path.read_text(), re.MULTILINE)}
    assert kinds == set(KINDS)
    assert all(load_faults(path).faults for path in SHIPPED)


def test_every_kind_and_key_is_explained() -> None:
    text = (ROOT / "docs" / "faults.md").read_text(encoding="utf-8")
    for kind, model in KINDS.items():
        assert f"`{kind}`" in text
        for key in model.model_fields:
            assert f"`{key}`" in text, f"docs/faults.md does not explain {key} of {kind}"


@given(
    start_s=st.floats(0.0, 100.0),
    lasts_s=st.floats(0.01, 10.0),
    pause_s=st.floats(0.01, 100.0),
    now_s=st.floats(0.0, 1000.0),
)
def test_a_repeated_fault_is_there_as_often_as_it_says(
    start_s: float, lasts_s: float, pause_s: float, now_s: float
) -> None:
    fault = Fault(start_s, start_s + lasts_s, repeat_s=lasts_s + pause_s)
    active, change_s = fault.at(now_s)
    assert change_s > now_s - 1e-5
    assert fault.at(0.5 * (max(now_s, change_s - 1e-3) + change_s - 2e-6))[0] == active or change_s - now_s < 1e-4
    assert fault.at(change_s)[0] != active


def test_a_fault_without_end_stays() -> None:
    assert Fault(5.0).at(4.0) == (False, 5.0)
    assert Fault(5.0).at(5.0) == (True, math.inf)
    assert Fault(5.0, 6.0).at(6.0) == (False, math.inf)
    assert Fault(5.0).at(-math.inf) == (False, 5.0)
