"""``run --from-autopilot``: the mission that the autopilot has stored, fetched over a real link and driven."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from typer.testing import CliRunner

from companion.cli.commands import app
from companion.cli.source import refuse_arming
from companion.executive.autopilot_mission import AGAIN_S, TRIES, MissionFetcher
from companion.mission.mission import Mission, MissionError, RoverSpec
from companion.mission.stored_mission import mission_of
from tests.scenarios.test_auto_legs import GUIDED_ENABLE, NONE, ON, WAYPOINT, Row, place_deg
from tests.support.asker import Asker
from tests.support.rig import ARM, AUTO, SET_MODE, yard
from tests.support.served import PATIENCE_S, finished, process, served, wait_until

LAND, DELAY = 21, 93
ROUND: list[Row] = [(WAYPOINT, NONE, (15, 7)), (DELAY, (1.0, 0.0, 0.0, 0.0), None), (WAYPOINT, NONE, (20, 3))]


def stored(rows: list[Row]) -> list[tuple[int, tuple[float, ...], tuple[int, int]]]:
    """As the autopilot has them: places in 1e-7 degrees."""
    places = (tuple(round(value * 1e7) for value in place_deg(field)) for _, _, field in rows)
    return [(command, params, (place[0], place[1])) for (command, params, _), place in zip(rows, places, strict=True)]


def holding(folder: Path, rows: list[Row]) -> Asker:
    """A rover whose autopilot has this mission."""
    rig = Asker(yard(folder), late_s=44.0)
    rig.run_for(3.0)
    if rows:
        rig.upload(stored(rows))
    return rig


def fetched(rig: Asker, show: Callable[[str], None] = lambda text: None) -> Mission:
    items = MissionFetcher(rig.link, rig, 20.0).fetch(show)
    assert items is not None
    return mission_of(items)


def test_it_is_fetched_and_driven(tmp_path: Path) -> None:
    rig = holding(tmp_path, ROUND)
    rig.restart_companion(replace(fetched(rig), rover=RoverSpec()))
    rig.finish()
    assert [str(status) for _, status in rig.companion.statuses()] == ["reached", "reached"]
    assert rig.passed_m(20, 3) < 0.7 and rig.simulator.collisions == ()


@pytest.mark.parametrize("seed", range(3))
def test_a_bad_line_only_takes_longer(tmp_path: Path, seed: int) -> None:
    rig = holding(tmp_path, ROUND)
    rng = np.random.default_rng(seed)

    def lossy(message: Any) -> Any:
        mine = message.get_type() in ("MISSION_COUNT", "MISSION_ITEM_INT")
        return None if mine and rng.random() < 0.4 else message

    rig.change = lossy
    assert [target.name for target in fetched(rig).targets] == ["waypoint 1", "waypoint 3"]


def test_an_autopilot_that_does_not_answer_is_one_line(tmp_path: Path) -> None:
    rig = holding(tmp_path, ROUND)
    rig.change = lambda message: None if message.get_type() == "MISSION_COUNT" else message
    with pytest.raises(MissionError, match="cannot be fetched: no answer to 5 requests; check the link"):
        fetched(rig)
    asked = [one for one in rig.sent if one.kind == "MISSION_REQUEST_LIST" and one.message.mission_type == 0]
    assert len(asked) == 5 * TRIES


def test_nothing_but_questions_is_sent_while_it_is_fetched(tmp_path: Path) -> None:
    rig = holding(tmp_path, ROUND)
    before = len(rig.sent)
    fetched(rig)
    assert [one for one in rig.sent[before:] if one.moves_or_changes] == []


def test_it_waits_for_the_autopilot_and_can_be_stopped(tmp_path: Path) -> None:
    rig = holding(tmp_path, ROUND)
    rig.cut, shown = True, []
    rig.restart_companion(yard(tmp_path))
    fetching = MissionFetcher(rig.link, rig, 20.0)

    def show(text: str) -> None:
        shown.append(text)
        if len(shown) == 30:
            fetching.stop()

    assert fetching.fetch(show) is None
    assert shown[0].startswith("waiting for the autopilot's heartbeat") and len(shown) == 30


@pytest.mark.parametrize(
    ("rows", "text"),
    [([], "there is none; upload one"), ([(LAND, NONE, (15, 7))], r"item 1: NAV_LAND \(21\)")],
    ids=["empty", "land"],
)
def test_what_cannot_be_driven_is_one_line(tmp_path: Path, rows: list[Row], text: str) -> None:
    with pytest.raises(MissionError, match=f"^the autopilot's mission: {text}"):
        fetched(holding(tmp_path, rows))


@pytest.mark.thorough
def test_a_mission_that_changes_on_the_way_is_told_and_the_old_one_driven(tmp_path: Path) -> None:
    rig = holding(tmp_path, ROUND)
    rig.restart_companion(fetched(rig))
    rig.until_driven(2.0)
    rig.upload(stored([*ROUND, (WAYPOINT, NONE, (20, 12))]))  # on a link of his own: only the number of items tells
    rig.until(lambda: any("mission has changed" in text for text in rig.texts()), 3.0)
    rig.finish()
    assert sum("mission has changed" in text for text in rig.texts()) == 1
    assert rig.passed_m(20, 3) < 0.7


@pytest.mark.thorough
def test_a_change_that_nothing_tells_of_is_found_within_a_minute(tmp_path: Path) -> None:
    rig = holding(tmp_path, [(WAYPOINT, NONE, (15, 7)), (DELAY, (90.0, 0.0, 0.0, 0.0), None)])
    rig.restart_companion(fetched(rig))
    rig.until_driven(2.0)
    rig.upload(stored([(WAYPOINT, NONE, (15, 8)), (DELAY, (90.0, 0.0, 0.0, 0.0), None)]))
    rig.until(lambda: any("mission has changed" in text for text in rig.texts()), AGAIN_S + 2.0)
    assert sum("mission has changed" in text for text in rig.texts()) == 1


def test_a_mission_of_the_autopilots_that_hands_over_is_driven_in_auto(tmp_path: Path) -> None:
    rig = holding(tmp_path, [(WAYPOINT, NONE, (4, 7)), (GUIDED_ENABLE, ON, (15, 7))])
    mission = fetched(rig)
    assert mission.in_auto and [target.name for target in mission.targets] == ["guided item 2"]


@pytest.mark.parametrize("arguments", [[], ["mission.toml", "--from-autopilot"]], ids=["neither", "both"])
def test_it_is_a_file_or_the_autopilot(arguments: list[str]) -> None:
    result = CliRunner().invoke(app, ["run", *arguments, "--connect", "tcp:127.0.0.1:9"])
    assert result.exit_code == 2
    assert result.stderr.count("\n") == 1 and "give a MISSION file or --from-autopilot" in result.stderr


def upload(url: str, rows: list[tuple[int, tuple[float, ...], tuple[int, int]]]) -> None:
    """By pymavlink alone."""
    host, port = url.removeprefix("tcp:").split(":")
    link: Any = mavutil.mavlink_connection(f"tcp:{host}:{port}", source_system=254, source_component=190)
    assert link.wait_heartbeat(timeout=PATIENCE_S) is not None
    rows = [(WAYPOINT, NONE, rows[0][2]), *rows]
    link.mav.mission_count_send(1, 1, len(rows), 0)
    while (
        asked := link.recv_match(type=["MISSION_REQUEST", "MISSION_ACK"], blocking=True, timeout=PATIENCE_S)
    ) is not None:
        if asked.get_type() == "MISSION_ACK":
            assert asked.type == mavlink.MAV_MISSION_ACCEPTED
            link.close()
            return
        command, params, place = rows[asked.seq]
        link.mav.mission_item_int_send(1, 1, asked.seq, 3, command, 0, 1, *params, *place, 0.0, 0)
    pytest.fail("the mission was not taken")


@pytest.mark.slow
def test_the_command_itself(tmp_path: Path) -> None:
    """Real processes: first without a mission in the autopilot, then with one."""
    with served(yard(tmp_path)) as world:
        arguments = ("--from-autopilot", "--connect", world.url, "--arm", "--state", tmp_path / "state")
        with process("companion", "run", *arguments) as run:
            code, _, err = finished(run)
        assert code == 2
        assert "the autopilot's mission: there is none; upload one" in err and "Traceback" not in err
        upload(world.url, stored([(WAYPOINT, NONE, (5, 9))]))
        with process("companion", "run", *arguments) as run:
            code, out, err = finished(run)
        assert code == 0, err
        assert out == "waypoint 1: reached\n"
        assert "fetching the mission" in err and "Traceback" not in err
        assert world.simulator.collisions == ()


@pytest.mark.thorough
@pytest.mark.slow
def test_the_command_drives_what_auto_hands_over(tmp_path: Path) -> None:
    """Real processes: a person arms and sets AUTO, the companion drives the leg and ends by itself."""
    with served(yard(tmp_path)) as world:
        upload(world.url, stored([(GUIDED_ENABLE, ON, (6, 9)), (WAYPOINT, NONE, (3, 9))]))
        with process("companion", "run", "--from-autopilot", "--connect", world.url) as run:
            assert any("a person to arm and to set AUTO" in line for line in iter(run.stderr.readline, ""))
            world.pilot(ARM, 1)
            wait_until(lambda: world.simulator.vehicle.armed)
            world.pilot(SET_MODE, 1, AUTO)
            code, out, err = finished(run)
        assert (code, out) == (0, "guided item 1: reached\n"), err
        assert world.simulator.vehicle.mode == AUTO, "the autopilot goes on"
        assert world.simulator.collisions == ()


def test_a_mission_that_hands_over_is_not_armed_for(tmp_path: Path) -> None:
    mission = fetched(holding(tmp_path, [(GUIDED_ENABLE, ON, (6, 9))]))
    refuse_arming(mission, arm=False)
    with pytest.raises(MissionError, match=r"the autopilot's mission: .* leave out --arm"):
        refuse_arming(mission, arm=True)


@pytest.mark.thorough
def test_it_is_taken_up_again_though_home_is_another(tmp_path: Path) -> None:
    """The autopilot tells its home of now as item 0, and that moves with every start."""
    rig = Asker(yard(tmp_path), late_s=44.0, state=tmp_path / "state")
    rig.run_for(3.0)
    rig.upload(stored(ROUND))
    first = replace(fetched(rig), rover=RoverSpec())
    rig.restart_companion(first)
    rig.until_driven(4.0)
    assert first.planned_home is not None
    home = replace(first.planned_home, lat_deg=first.planned_home.lat_deg + 1e-5)
    rig.restart_companion(replace(first, planned_home=home), resume=True)
    rig.finish()
    assert any(text.startswith("Resumed with its map") for text in rig.texts())
    assert rig.companion.outcome.complete
