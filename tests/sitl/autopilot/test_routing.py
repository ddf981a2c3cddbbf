"""Packets between several links of one vehicle."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.routing import MOST_ROUTES, Router
from sitl.simulator import Simulator
from tests.support.party import AUTOPILOT_VERSION, HOLD, REQUEST_MESSAGE, SET_MODE, Party, booted


@pytest.fixture
def simulator() -> Simulator:
    return booted()


@pytest.fixture
def trio(simulator: Simulator) -> tuple[Party, Party, Party]:
    """Companion, ground station and a gimbal of the vehicle's, each on a link of its own; all have been heard."""
    parties = (Party(simulator, 1, 191, 0), Party(simulator, 255, 190, 1), Party(simulator, 1, 154, 2))
    for party, kind in zip(parties, (18, 6, 26), strict=True):
        party.beat(kind)
    simulator.advance_to_s(simulator.time_s + 0.1)
    for party in parties:
        party.link.take()
    return parties


def test_heartbeats_go_to_everybody_else_and_never_back(trio: tuple[Party, Party, Party]) -> None:
    companion, ground, gimbal = trio
    sent = companion.beat(18)
    assert sent not in companion.raw()
    assert sent in ground.link.take()
    assert sent in gimbal.link.take()


def test_a_heartbeat_does_not_reach_a_link_where_nobody_spoke(trio: tuple[Party, Party, Party]) -> None:
    companion, ground, _ = trio
    silent = Party(companion.simulator, 9, 9)
    sent = companion.beat(18)
    assert sent not in silent.raw()
    assert sent in ground.link.take()


def test_what_has_no_target_goes_to_everybody_else(trio: tuple[Party, Party, Party]) -> None:
    companion, ground, gimbal = trio
    sent = companion.send(mavlink.MAVLink_named_value_float_message(1, b"room", 2.5))
    assert sent not in companion.raw()
    assert ground.link.take().count(sent) == 1
    assert gimbal.link.take().count(sent) == 1


def test_a_command_for_a_component_goes_there_and_only_there(trio: tuple[Party, Party, Party]) -> None:
    companion, ground, gimbal = trio
    sent = ground.command(SET_MODE, 1, HOLD, to=(1, 191))
    assert ground.acks() == []
    assert sent in companion.link.take()
    assert sent not in gimbal.link.take()


def test_a_command_for_a_component_nobody_knows_is_answered_by_the_autopilot(trio: tuple[Party, Party, Party]) -> None:
    companion, ground, gimbal = trio
    sent = ground.command(SET_MODE, 1, HOLD, to=(1, 77))
    assert ground.acks() == [0]
    assert sent not in companion.link.take() + gimbal.link.take()


def test_so_is_one_for_a_component_on_the_senders_own_link(trio: tuple[Party, Party, Party]) -> None:
    ground = trio[1]
    ground.command(SET_MODE, 1, HOLD, to=(1, 190))
    assert ground.acks() == [0]


def test_the_autopilots_own_commands_are_passed_on_to_nobody(trio: tuple[Party, Party, Party]) -> None:
    companion, ground, gimbal = trio
    sent = ground.command(SET_MODE, 1, HOLD)
    assert ground.acks() == [0]
    assert sent not in companion.link.take() + gimbal.link.take()


@pytest.mark.parametrize("target", [(0, 0), (1, 0), (0, 1)])
def test_broadcast_commands_are_done_and_passed_on(trio: tuple[Party, Party, Party], target: tuple[int, int]) -> None:
    companion, ground, gimbal = trio
    sent = ground.command(SET_MODE, 1, HOLD, to=target)
    assert ground.acks() == [0]
    assert sent in companion.link.take()
    assert sent in gimbal.link.take()


def test_another_systems_packets_go_wherever_that_system_was_heard(trio: tuple[Party, Party, Party]) -> None:
    companion, ground, gimbal = trio
    sent = companion.command(REQUEST_MESSAGE, AUTOPILOT_VERSION, to=(255, 17))
    assert companion.acks() == []
    assert sent in ground.link.take()
    assert sent not in gimbal.link.take()
    assert companion.command(SET_MODE, 1, HOLD, to=(42, 1)) not in ground.raw()
    assert companion.acks() == []


def test_what_a_radio_says_of_itself_stays_where_it_is(trio: tuple[Party, Party, Party]) -> None:
    companion, ground, _ = trio
    sent = ground.send(mavlink.MAVLink_radio_status_message(200, 200, 99, 30, 30, 0, 0))
    assert sent not in companion.raw()


def test_the_autopilots_own_words_come_back_without_effect(trio: tuple[Party, Party, Party]) -> None:
    companion, ground, _ = trio
    liar = Party(companion.simulator, 1, 1)
    sent = liar.command(SET_MODE, 1, HOLD)
    assert liar.acks() == []
    assert sent not in companion.link.take() + ground.link.take()


def test_a_closed_link_is_forgotten(trio: tuple[Party, Party, Party]) -> None:
    companion, ground, _ = trio
    companion.simulator.disconnect(companion.link)
    ground.command(SET_MODE, 1, HOLD, to=(1, 191))
    assert ground.acks() == [0]


def test_the_echo_trap(simulator: Simulator) -> None:
    """With PRX1_TYPE=2 a companion's own scan comes back to it as the autopilot's DISTANCE_SENSOR 10 to 17."""
    companion, ground = Party(simulator, 1, 191), Party(simulator, 255, 190, 1)
    for party in (companion, ground):
        party.beat()
    ground.send(mavlink.MAVLink_param_set_message(1, 1, b"PRX1_TYPE", 2, 9))
    ground.command(511, 132, 100_000)
    cells = [801] * 72
    cells[0] = 250
    scan = mavlink.MAVLink_obstacle_distance_message(0, 0, cells, 5, 10, 800, 5.0, 0.0, 12)
    sent = b""
    for _ in range(20):
        sent = companion.send(scan)
        simulator.advance_to_s(simulator.time_s + 0.1)
    got, on_the_ground = companion.raw(), ground.link.take()
    assert sent not in got
    assert sent in on_the_ground
    echoes = [m for m in mavlink.MAVLink(None).parse_buffer(got) or [] if m.get_type() == "DISTANCE_SENSOR"]
    assert {(m.get_srcSystem(), m.get_srcComponent()) for m in echoes} == {(1, 1)}
    assert {m.id for m in echoes} == set(range(10, 18))
    assert {m.current_distance for m in echoes if m.orientation == 0} == {250}
    assert {m.current_distance for m in echoes if m.orientation != 0} == {800}
    both = [m.get_type() for m in mavlink.MAVLink(None).parse_buffer(on_the_ground) or []]
    assert both.count("DISTANCE_SENSOR") > 100


def test_a_component_may_be_on_two_channels() -> None:
    router = Router()
    for channel in (0, 0, 3):
        router.learn(1, 191, channel)
    router.learn(0, 5, 4)
    assert router.forward_to(1, 1, 191, source=2) == {0, 3}
    assert router.heartbeat_to(1, 191, 5, active={0, 3, 4, 5}) == {4}
    assert router.forward_to(1, 0, 0, source=2) == {0, 3}


def test_the_routing_table_has_an_end() -> None:
    router = Router()
    for component in range(1, 100):
        router.learn(7, component, component)
    assert len(router.forward_to(1, 7, 0, source=0)) == MOST_ROUTES
