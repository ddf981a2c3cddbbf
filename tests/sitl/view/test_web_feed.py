"""What a page is told of the simulator alone: the true world, the rover, who is connected, what happens."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from companion.viewer.map_tiles import TILE, cells_of
from companion.viewer.tile_kernels import CLOSED, COSTLY, FREE, SEEN_OBSTACLE
from sitl.network.event_log import EventLog
from sitl.simulator import Simulator
from sitl.view.true_rays import rays_of
from sitl.view.web_feed import HEARD_S, WebFeed
from sitl.world.doors import Door
from sitl.world.movers import Mover
from sitl.world.truth import SimStart
from sitl.world.world import World
from tests.companion.viewer.test_feed import KEYS, Heard
from tests.support.sitl_client import HOME, Client

SIZE = 20
TARGETS = [{"name": "gate", "place": [0.0, 15.0]}]
START = SimStart(10.5, 2.5, np.pi / 2.0, HOME)


def the_world() -> World:
    """A wall 8 m east of the start, a door in it that opens at 50 s, mud, and a cart."""
    walls, door, ground = np.zeros((SIZE, SIZE), np.bool_), np.zeros((SIZE, SIZE), np.bool_), np.ones((2, SIZE, SIZE))
    walls[:, 10], door[4, 10], walls[4, 10], ground[1, 15:17, 2:5] = True, True, False, 0.5
    cart = Mover("cart", 0.3, np.array([[0.0, 18.0, 5.0], [100.0, 18.0, 15.0]]))
    return World(walls, movers=(cart,), doors=(Door("gate", door, ((50_000, 70_000),)),), ground=np.float32(ground))


class Watched:
    """A simulator and its feed, looked at ten times a second as if real time went with it."""

    def __init__(self, **options: Any) -> None:
        self.simulator = Simulator(the_world(), START, "lidar-360", noise=False, **options)
        self.page, self.said = Heard(), []
        self.feed = WebFeed(self.simulator, self.page, "Yard", "connect to me", self.said.append, TARGETS)
        self.log = EventLog(
            lambda line: None, lambda: self.simulator.time_s, lambda line: self.feed.tell(line, "error")
        )

    def run_to(self, time_s: float, client: Client | None = None) -> dict:
        """The frame of this time."""
        while self.simulator.time_s < time_s - 1e-6:
            if client is not None:
                client.command(512, 1.0)  # a client that talks
                client.run_for(0.2)
            self.simulator.advance_to_s(self.simulator.time_s + 0.2)
            self.log.look(self.simulator)
            self.feed.show(self.simulator.time_s)
        return self.page.frames[-1]

    def cells(self) -> np.ndarray:
        (tile,) = self.page.tiles.values()
        return cells_of(tile).reshape(TILE, TILE)[:SIZE, :SIZE]


def test_it_says_what_it_waits_for_and_what_it_does_until_it_touches_a_wall() -> None:
    watched = Watched()
    frame = watched.run_to(1.0)
    assert set(frame) == KEYS | {"driven_m"}
    assert (frame["state"], frame["why"]) == ("waiting", "connect to me") and "simulator: waiting" in frame["line"]
    assert frame["gps"]["fix"] == "no GPS" and frame["pose"] == [0.0, 0.0, pytest.approx(np.pi / 2.0, abs=1e-3)]
    client = Client(watched.simulator)
    assert "knows its position in 3" in watched.run_to(3.0, client)["why"]
    frame = watched.run_to(44.0, client)
    assert frame["line"] == "simulator: disarmed in MANUAL" and frame["why"] == "waiting for somebody to arm it"
    assert client.set_mode(15) == 0 and client.arm() == 0
    assert watched.run_to(44.8, client)["why"] == "waiting for a target"
    client.drive_to(0.0, 20.0)
    frame = watched.run_to(47.0, client)
    assert frame["line"] == "simulator: driving in GUIDED" and frame["drives"] == "companion or ground station"
    assert frame["goal"]["place"] == pytest.approx([0.0, 20.0], abs=0.1) and frame["speed"] > 0.5
    (link,) = frame["rates"]["links"]
    assert link["heard"] and link["in"] > 1.0 and link["out"] > 1.0
    frame = watched.run_to(54.0, client)
    assert frame["contacts"] >= 1 and frame["figures"]["clearance_m"] == pytest.approx(0.0, abs=0.05)
    silent = watched.run_to(watched.simulator.time_s + HEARD_S + 1.0)
    assert not silent["rates"]["links"][0]["heard"]
    news = [(one["level"], one["text"]) for frame in watched.page.frames for one in frame["news"]]
    assert ("notice", "mode GUIDED now, MANUAL before") in news and ("notice", "the rover is armed now") in news
    assert next(text for level, text in news if level == "error").startswith("collision 1: the rover, driving ")
    assert watched.said == []


def test_a_simulator_that_is_stopped_says_so_last_and_once() -> None:
    watched = Watched()
    watched.run_to(1.0)
    watched.feed.end(1.1)
    told = len(watched.page.frames)
    last = watched.run_to(2.0)
    assert (last["state"], last["line"], last["why"]) == ("ended", "the simulator was stopped", "")
    assert len(watched.page.frames) == told and watched.said == []


def test_the_map_is_the_world_as_it_is_now() -> None:
    watched = Watched()
    frame = watched.run_to(1.0)
    (scene,) = watched.page.scenes
    assert scene["targets"] == TARGETS
    assert scene["truth"] is True and scene["map"]["west_m"] == -2.5 and scene["map"]["south_m"] == -10.5
    cells = watched.cells()
    assert (cells[:, 10] == SEEN_OBSTACLE).all() and cells[15, 3] == COSTLY and cells[0, 0] == FREE
    assert frame["movers"][0]["name"] == "cart" and frame["movers"][0]["velocity"] == [0.0, pytest.approx(0.1)]
    watched.page.tiles.clear()
    watched.run_to(49.8)
    assert not watched.page.tiles, "nothing has changed"
    watched.run_to(51.0)
    assert watched.cells()[4, 10] == CLOSED and watched.cells()[5, 10] == SEEN_OBSTACLE
    watched.page.tiles.clear()
    watched.page.begins_anew.set()
    watched.run_to(52.0)
    assert len(watched.page.tiles) == 1 and len(watched.page.scenes) == 2


def test_rays_end_at_walls_and_beams_are_narrow() -> None:
    rays = rays_of(Simulator(the_world(), START, "lidar-360", noise=False))
    assert rays is not None and rays["m"][0] == pytest.approx(7.5, abs=0.01) and rays["m"][36] == rays["max_m"]
    rays = rays_of(Simulator(the_world(), START, "beams", noise=False))
    assert rays is not None and sum(one is not None for one in rays["m"]) == 3 + 2 + 2
    assert rays_of(Simulator(the_world(), START, "none", noise=False)) is None


def test_a_fault_of_the_picture_is_told_once_and_the_simulator_goes_on() -> None:
    watched = Watched()
    watched.page.put = None  # type: ignore[method-assign]
    watched.simulator.advance_to_s(1.0)
    for time_s in (1.0, 2.0, 3.0):
        watched.feed.show(time_s)
    assert len(watched.said) == 1 and watched.said[0].startswith("the page has no more news, the simulator goes on: ")
