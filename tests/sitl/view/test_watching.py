"""What the terminal view collects from the simulator."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.frames import GeoPoint
from sitl.sim_link import PacketCounter
from sitl.simulator import Simulator
from sitl.view.watching import Rates, Watching
from sitl.world.doors import Door
from sitl.world.movers import Mover, timed_track
from sitl.world.truth import SimStart
from sitl.world.world import World
from tests.companion.viewer.terminal.test_screen import screen
from tests.support.sitl_client import HOME, READY_S, Client, open_ground, ready


def test_the_simulator_as_it_is_seen() -> None:
    fields = np.zeros((20, 30), dtype=np.bool_)
    fields[0] = True
    door = np.zeros_like(fields)
    door[5, 5:8] = True
    mover = Mover("m", 0.4, timed_track([(10.0, 20.0), (10.0, 25.0)], 1.0, 0.0, repeats=True), True, "")
    world = World(fields, movers=(mover,), doors=(Door("d", door, ((2000, 4000),)),))
    simulator = Simulator(world, SimStart(10.5, 3.5, math.radians(90.0), GeoPoint(0.0, 0.0)), "none", noise=False)
    link = simulator.connect(name="tcp:1.2.3.4:5")
    watching = Watching("Yard", simulator)
    simulator.advance_to_s(1.0)
    closed = "\n".join(screen(watching.view(0.0)))
    for text in ("Yard: 30 x", "MANUAL, disarmed", "no GPS", "90° E", "tcp:1.2.3.4:5", "door closed", "→", "o moving"):
        assert text in closed
    simulator.advance_to_s(3.0)
    link.take()
    opened = "\n".join(screen(watching.view(1.0)))
    assert "door open" in opened and "door closed" not in opened and "2.0 times" in opened and "out " in opened


def test_the_last_collision_is_shown_with_time_speed_and_what() -> None:
    solid = np.zeros((20, 20), dtype=np.bool_)
    solid[6] = True
    simulator = Simulator(World(solid, 1.0), SimStart(2.5, 10.0, 0.0, HOME), sensors="none", noise=False)
    watching = Watching("Wall", simulator)
    assert ("collisions", "0") in [(fact.name, fact.value) for fact in watching.vehicle_section(0.0).facts]
    client = ready(simulator)
    client.drive_to(6.0, 0.0)
    client.run_for(6.0)
    (hit,) = simulator.collisions
    (shown,) = (fact for fact in watching.vehicle_section(0.0).facts if fact.name == "collisions")
    assert shown.alarm and shown.value == f"1, last at {hit.time_s:.1f} s, {hit.speed_m_s:.1f} m/s, an obstacle"


def test_way_and_target_are_shown() -> None:
    simulator = open_ground()
    client = Client(simulator)
    client.run_for(READY_S)
    client.set_mode(15)
    client.arm()
    client.drive_to(8.0, 0.0)
    watching = Watching("Open", simulator)
    for _ in range(6):
        client.run_for(0.5)
        view = watching.view(0.0)
    text = "\n".join(screen(view))
    assert "GUIDED, armed" in text and "◎" in text and "↑" in text and "• way" in text and "position known" in text
    assert any(place.name == "target" and place.north_m == pytest.approx(8.0, abs=0.1) for place in view.sketch.places)


def test_after_a_reboot_the_destination_is_where_the_rover_goes_and_the_news_tell() -> None:
    simulator = open_ground()
    watching = Watching("Open", simulator)
    origin_m = 0.0
    for leg in range(2):
        client = Client(simulator)
        client.run_for(READY_S)
        watching.note()
        client.set_mode(15)
        client.arm()
        client.drive_to(8.0, 0.0)
        client.run_for(1.0)
        (target,) = (place for place in watching.sketch().places if place.name == "target")
        assert target.north_m - simulator.start.north_m == pytest.approx(origin_m + 8.0, abs=0.1)
        if leg == 0:
            client.run_for(6.0)
            origin_m = simulator.truth.north_m - simulator.start.north_m
            assert origin_m > 4.0
            client.command(400, 0.0)
            client.command(246, 1.0)
            simulator.advance_to_s(simulator.time_s + 0.5)
            watching.note()
    told = [text.partition(" s: ")[2] for text in watching.events]
    begun = ["mode GUIDED now, MANUAL before", "the rover is armed now"]
    assert told == [*begun, "the autopilot has started anew: MANUAL, disarmed", *begun]


def test_rates_count_since_a_while_ago() -> None:
    rates = Rates()
    for tenth in range(100):
        told = rates.update(tenth / 10.0, {"a": (tenth, 5 * tenth)})
    assert told["a"] == (pytest.approx(10.0), pytest.approx(50.0))
    assert rates.update(10.0, {"b": (3, 4)})["b"][0] < 3.0


@given(st.lists(st.tuples(st.sampled_from([0xFD, 0xFE]), st.integers(0, 255), st.booleans())), st.integers(1, 50))
def test_packets_are_counted_wherever_the_stream_is_cut(packets: list[tuple[int, int, bool]], piece: int) -> None:
    stream = b""
    for magic, length, signed in packets:
        rest = length + (8 if magic == 0xFE else 12 + 13 * signed) - 3
        stream += bytes([magic, length, int(signed)]) + bytes([0xFD]) * rest
    counter = PacketCounter()
    for start in range(0, len(stream), piece):
        counter.feed(stream[start : start + piece])
    assert counter.packets == len(packets)
