"""How near a rover has come to anything: as if every tick had been measured, with few measurements."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sitl.campaign.drive_run import Nearest
from sitl.plant.outline import Outline
from sitl.world.movers import Mover
from sitl.world.truth import Collision, Truth

BAR = Outline(0.0, 0.8, 0.8, 0.3)


class FakeSimulator:
    """A rover that passes a post beside its way, and turns meanwhile; ``mover``: something drives past it."""

    def __init__(self, outline: Outline, *, mover: bool) -> None:
        track = np.array([[0.0, 0.0, 0.0], [10.0, 21.3, 0.5]])
        self.world = SimpleNamespace(doors=(), movers=(Mover("one", 0.3, track),) if mover else ())
        self.outline, self.collisions, self.measured = outline, (), 0
        self.truth = self.at(0.0)

    def at(self, time_s: float) -> Truth:
        self.truth = Truth(time_s, 1.63 * time_s, 3.0, 0.7 * time_s, 1.63, 0.7)
        return self.truth

    def room_m(self) -> float:
        now = self.truth
        post_m = math.hypot(now.north_m - 8.0, now.east_m - 4.5)
        mover_m = (
            math.hypot(now.north_m - 2.13 * now.time_s, now.east_m - 0.05 * now.time_s)
            if self.world.movers
            else math.inf
        )
        half_m = self.outline.radius_m or 0.3 + 0.5 * abs(math.sin(now.heading_rad))
        return min(max(min(post_m, mover_m) - half_m, 0.0), 5.0)

    @property
    def clearance_m(self) -> float:
        self.measured += 1
        return self.room_m()


def nearest(simulator: FakeSimulator, clock: Any) -> Nearest:
    run: Any = SimpleNamespace(simulator=simulator, clock=clock)
    return Nearest(run)


@pytest.mark.parametrize("outline", [Outline(0.35), BAR], ids=["disc", "bar"])
@pytest.mark.parametrize("mover", [False, True])
def test_it_is_as_if_every_tick_had_been_measured(outline: Outline, mover: bool) -> None:
    simulator = FakeSimulator(outline, mover=mover)
    heard: list[float] = []
    clock: Any = SimpleNamespace(delivered=lambda time_s, data: heard.append(time_s))
    near = nearest(simulator, clock)
    rooms_m = []
    for tick in range(1, 201):
        simulator.at(0.05 * tick)
        rooms_m.append(simulator.room_m())
        clock.delivered(0.05 * tick, b"")
    assert near.clearance_m == min(rooms_m) < min(rooms_m[::10]), "twice a second is not enough"
    assert simulator.measured < 150 and len(heard) == 200, "who listened before still does"


@pytest.mark.parametrize(("speed_m_s", "mover", "clearance_m"), [(0.4, None, 0.0), (0.0, "cart", 5.0)])
def test_a_contact_of_a_rover_that_moves_is_no_room_at_all(
    speed_m_s: float, mover: str | None, clearance_m: float
) -> None:
    simulator = FakeSimulator(BAR, mover=False)
    near = nearest(simulator, SimpleNamespace(delivered=None))
    simulator.collisions = (Collision(1.0, 0.0, 0.0, mover, speed_m_s),)  # type: ignore[assignment]
    assert near.clearance_m == clearance_m
