"""Four environments with as many static and moving obstacles as those of Wang, Sillitoe & Mulvaney 2007 (table I).

Fields are 1 m wide. The paper shows its environments in pictures only; ours fit its text: obstacles that travel to and
fro between two places in the first two, along several segments at several speeds in the others. After the change they
go elsewhere, at the speeds of table III.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import chain, cycle

import numpy as np
import shapely
from numpy.typing import NDArray

from companion.core.grid import BASE_WEIGHT, OBSTACLE, Cell, Weights
from companion.planning.problem import ObstacleTrajectory

Track = NDArray[np.float64]
Place = tuple[float, float]

SIZE_M = 500
START, TARGET = Cell(15, 15), Cell(485, 485)
HORIZON_S = 6000.0
"""Longer than any plan takes."""


@dataclass(frozen=True, slots=True)
class Patrol:
    """Through places and back again, for ever; stretch i, forth or back, at ``speeds_m_s[i]``."""

    places: tuple[Place, ...]
    speeds_m_s: tuple[float, ...]

    def track(self, came_from: Place | None = None) -> Track:
        """Rows time, x, y from time 0, beginning at the first place, or elsewhere with a first stretch to it."""
        stretches = len(self.speeds_m_s)
        forth = [(self.places[i + 1], self.speeds_m_s[i]) for i in range(stretches)]
        back = [(self.places[i], self.speeds_m_s[i]) for i in reversed(range(stretches))]
        first = [] if came_from is None else [(self.places[0], self.speeds_m_s[0])]
        x, y = self.places[0] if came_from is None else came_from
        rows = [(0.0, x, y)]
        for (to_x, to_y), speed in chain(first, cycle(forth + back)):
            if rows[-1][0] > HORIZON_S:
                break
            rows.append((rows[-1][0] + math.hypot(to_x - x, to_y - y) / speed, to_x, to_y))
            x, y = to_x, to_y
        return np.array(rows)


@dataclass(frozen=True, slots=True)
class Moving:
    """A moving obstacle: how it goes at first, and how after the change."""

    radius_m: float
    before: Patrol
    after: Patrol


@dataclass(frozen=True, slots=True)
class Environment:
    """Static obstacles as corners, moving ones, and when their motion changes."""

    static: tuple[tuple[Place, ...], ...]
    moving: tuple[Moving, ...]
    change_s: float
    start: Cell = START
    target: Cell = TARGET

    def weights(self) -> Weights:
        """The map."""
        x, y = np.meshgrid(np.arange(SIZE_M, dtype=float), np.arange(SIZE_M, dtype=float))
        weights = np.full((SIZE_M, SIZE_M), BASE_WEIGHT)
        for corners in self.static:
            weights[shapely.contains_xy(shapely.Polygon(corners), x, y)] = OBSTACLE
        return weights

    def movers(self) -> tuple[ObstacleTrajectory, ...]:
        """As they move at first."""
        return tuple(ObstacleTrajectory(moving.radius_m, moving.before.track()) for moving in self.moving)

    def movers_after(self) -> tuple[ObstacleTrajectory, ...]:
        """As they move from the change on; its moment is their time 0, where they are then their first place."""
        return tuple(
            ObstacleTrajectory(moving.radius_m, moving.after.track(place_at(moving.before.track(), self.change_s)))
            for moving in self.moving
        )


def place_at(track: Track, time_s: float) -> Place:
    """Where a track is at a time."""
    times, x, y = track.T
    return float(np.interp(time_s, times, x)), float(np.interp(time_s, times, y))


def _to_and_fro(a: Place, b: Place, speed_m_s: float) -> Patrol:
    return Patrol((a, b), (speed_m_s,))


ONE = Environment(
    static=(
        ((80, 70), (170, 50), (205, 120), (140, 180), (75, 140)),
        ((260, 50), (390, 80), (370, 170), (270, 150)),
        ((100, 260), (200, 220), (250, 300), (190, 390), (110, 350)),
        ((320, 240), (430, 260), (445, 380), (360, 410), (310, 330)),
    ),
    moving=(
        Moving(14, _to_and_fro((290, 200), (238, 225), 0.4), _to_and_fro((232, 240), (290, 200), 0.1)),
        Moving(10, _to_and_fro((280, 440), (300, 210), 0.5), _to_and_fro((255, 420), (300, 190), 0.55)),
    ),
    change_s=400.0,
)
TWO = Environment(
    static=(
        ((60, 40), (150, 30), (140, 110), (70, 120)),
        ((190, 70), (300, 40), (330, 130), (220, 170)),
        ((50, 180), (150, 165), (200, 240), (150, 310), (60, 290)),
        ((260, 230), (370, 190), (420, 290), (330, 350), (250, 320)),
        ((180, 380), (300, 400), (320, 460), (200, 470)),
    ),
    moving=(
        Moving(8, Patrol(((170, 30), (150, 150)), (0.3,)), Patrol(((215, 200), (225, 330), (240, 370)), (0.4, 0.1))),
        Moving(15, _to_and_fro((420, 150), (230, 205), 0.52), _to_and_fro((222, 246), (300, 170), 0.2)),
        Moving(10, _to_and_fro((240, 360), (440, 380), 0.6), _to_and_fro((350, 380), (460, 290), 0.5)),
    ),
    change_s=380.0,
)
THREE = Environment(
    static=(
        ((50, 50), (110, 40), (120, 100), (60, 110)),
        ((160, 30), (240, 50), (220, 120), (150, 110)),
        ((290, 60), (380, 40), (390, 130), (310, 140)),
        ((60, 160), (140, 150), (150, 230), (80, 250)),
        ((190, 170), (290, 160), (300, 260), (200, 250)),
        ((350, 190), (440, 180), (450, 270), (370, 290)),
        ((70, 310), (160, 290), (170, 380), (90, 400)),
        ((210, 310), (310, 300), (320, 400), (230, 410)),
        ((370, 340), (450, 330), (440, 420), (380, 430)),
    ),
    moving=(
        Moving(
            6,
            Patrol(((30, 130), (160, 130), (170, 260)), (0.5, 0.3)),
            Patrol(((160, 130), (175, 270), (60, 275)), (0.3, 0.5)),
        ),
        Moving(
            8,
            Patrol(((270, 40), (260, 140), (330, 160)), (0.6, 0.8)),
            Patrol(((330, 160), (325, 290), (420, 315)), (1.1, 0.4)),
        ),
        Moving(
            8,
            Patrol(((180, 420), (185, 280), (330, 280), (345, 430)), (0.7, 0.5, 0.6)),
            Patrol(((190, 280), (330, 285), (345, 440), (440, 450)), (0.7, 0.4, 0.6)),
        ),
        Moving(
            6,
            Patrol(((460, 160), (340, 160), (330, 300), (460, 310), (465, 450)), (0.9, 0.6, 0.5, 0.7)),
            Patrol(((345, 300), (345, 450), (460, 450), (470, 310), (400, 310)), (1.2, 0.5, 0.4, 0.8)),
        ),
    ),
    change_s=300.0,
)
FOUR = Environment(
    static=(
        ((40, 45), (90, 35), (100, 85), (55, 95)),
        ((130, 25), (190, 30), (180, 80), (140, 90)),
        ((230, 50), (300, 35), (290, 100), (240, 105)),
        ((350, 40), (440, 60), (420, 120), (345, 110)),
        ((35, 140), (90, 130), (110, 190), (50, 210)),
        ((135, 125), (210, 135), (200, 200), (150, 190)),
        ((250, 140), (320, 150), (310, 215), (245, 205)),
        ((365, 160), (450, 165), (430, 230), (370, 225)),
        ((60, 260), (130, 240), (140, 310), (75, 325)),
        ((180, 245), (260, 250), (250, 320), (185, 310)),
        ((300, 260), (390, 270), (375, 340), (310, 330)),
        ((100, 370), (190, 355), (200, 430), (115, 440)),
        ((235, 365), (320, 375), (310, 440), (245, 430)),
        ((365, 380), (440, 375), (445, 440), (380, 445)),
    ),
    moving=(
        Moving(6, _to_and_fro((20, 112), (225, 112), 0.67), _to_and_fro((225, 225), (290, 240), 0.9)),
        Moving(
            6,
            Patrol(((120, 220), (225, 225), (230, 100)), (0.8, 0.5)),
            Patrol(((225, 225), (280, 235), (285, 345)), (1.4, 0.7)),
        ),
        Moving(
            8,
            Patrol(((340, 120), (345, 240), (270, 240), (275, 345)), (0.9, 0.4, 0.6)),
            Patrol(((345, 240), (280, 245), (280, 350), (345, 360)), (1.1, 0.2, 0.5)),
        ),
        Moving(
            8,
            Patrol(((160, 335), (340, 350), (345, 450)), (0.5, 0.7)),
            Patrol(((340, 352), (345, 455), (450, 460)), (0.3, 1.1)),
        ),
        Moving(
            6,
            Patrol(((470, 250), (410, 250), (405, 355), (470, 360)), (1.0, 0.6, 0.8)),
            Patrol(((470, 470), (455, 360), (405, 355), (400, 250)), (1.6, 0.5, 0.6)),
        ),
    ),
    change_s=320.0,
)

ENVIRONMENTS = {1: ONE, 2: TWO, 3: THREE, 4: FOUR}
