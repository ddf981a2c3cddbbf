"""The parameters that a rover with a companion should have, and why: one table for files, checks and the documentation.

Nouns: wanted parameter.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum, StrEnum

from companion.vehicle.guard import IN_TIME_S
from companion.vehicle.recommended_parameters import RECOMMENDED_PARAMETERS

INT8, INT16, INT32, REAL32 = 2, 4, 6, 9
"""MAV_PARAM_TYPE: QGroundControl's files bear it."""
S_CURVES = 64
"""Bit of GUID_OPTIONS."""
GUARD_MS = 300.0
SAME = 1e-4
"""A parameter is a 32-bit float on its way."""


class Rule(Enum):
    """How the rover's value is compared with the wanted one."""

    EQUAL = "{:g}"
    AT_MOST = "{:g} or less"
    AT_LEAST = "{:g} or more"
    NOT = "not {:g}"
    WITHOUT = "without {:g}"


class Use(StrEnum):
    """Which rovers a parameter is for."""

    ALWAYS = "every rover"
    GUARD = "with the guard (--guard)"
    STATION = "with a ground station (--station)"


@dataclass(frozen=True, slots=True)
class WantedParameter:
    """One parameter: the ``value`` to write, and the ``rule`` and ``bound`` by which the rover's own is judged."""

    name: str
    value: float
    kind: int
    why: str
    use: Use = Use.ALWAYS
    rule: Rule = Rule.EQUAL
    bound: float | None = None

    @property
    def judged_by(self) -> float:
        """The number of the rule."""
        return self.value if self.bound is None else self.bound

    @property
    def wish(self) -> str:
        """What the rover should have, in words."""
        return self.rule.value.format(self.judged_by)

    def accepts(self, value: float) -> bool:
        """Whether the rover's value will do."""
        if not math.isfinite(value):
            return False
        match self.rule:
            case Rule.EQUAL:
                return math.isclose(value, self.judged_by, rel_tol=SAME, abs_tol=SAME)
            case Rule.AT_MOST:
                return value <= self.judged_by + SAME
            case Rule.AT_LEAST:
                return value >= self.judged_by - SAME
            case Rule.NOT:
                return not math.isclose(value, self.judged_by)
            case Rule.WITHOUT:
                return not int(value) & int(self.judged_by)


def wanted_parameters(cruise_speed_m_s: float) -> tuple[WantedParameter, ...]:
    """The whole table, for a mission with this speed."""
    return tuple(_table(cruise_speed_m_s))


def for_rover(
    table: Iterable[WantedParameter], *, guard: bool = False, station: bool = False
) -> tuple[WantedParameter, ...]:
    """The parameters that a rover needs, with a guard on its autopilot and a ground station or without."""
    uses = {Use.ALWAYS, *([Use.GUARD] if guard else []), *([Use.STATION] if station else [])}
    return tuple(one for one in table if one.use in uses)


def _table(speed_m_s: float) -> Iterable[WantedParameter]:
    recommended = RECOMMENDED_PARAMETERS
    why = "the companion goes round obstacles; while the autopilot does it itself it ignores new targets"
    yield WantedParameter("OA_TYPE", recommended["OA_TYPE"], INT8, why)
    why = "the autopilot's simple avoidance creeps towards obstacles and stays there, without a word"
    yield WantedParameter("AVOID_ENABLE", recommended["AVOID_ENABLE"], INT8, why)
    why = "with S-curves (64) every repeated target nearly stops the rover"
    yield WantedParameter("GUID_OPTIONS", 0.0, INT32, why, rule=Rule.WITHOUT, bound=S_CURVES)
    why = "seconds for which the last velocity goes on if the companion dies; with 1 planned motions are faster"
    yield WantedParameter("GUID_TIMEOUT", 1.0, REAL32, why, rule=Rule.AT_MOST, bound=3.0)
    why = "metres: the companion aims far ahead, and a small radius keeps the rover on its line"
    yield WantedParameter("WP_RADIUS", recommended["WP_RADIUS"], REAL32, why, rule=Rule.AT_MOST, bound=2.0)
    why = "m/s³: with less the rover begins and ends its ways slowly; the companion was tried with 3"
    yield WantedParameter("WP_JERK", recommended["WP_JERK"], REAL32, why)
    why = "m/s: the top speed towards guided targets; the mission's cruise_speed_m_s"
    yield WantedParameter("WP_SPEED", speed_m_s, REAL32, why, rule=Rule.AT_LEAST)
    why = "the pilot's steering stick, by which the companion notices that a person takes the rover"
    yield WantedParameter("RCMAP_ROLL", 1.0, INT8, why)
    yield WantedParameter("RCMAP_THROTTLE", 3.0, INT8, "the pilot's throttle stick, likewise")
    why = "a failsafe stops the rover (2, HOLD); RTL drives home through whatever is in the way"
    yield WantedParameter("FS_ACTION", 2.0, INT8, why)
    why = "a rover that has lost its position stops (1, HOLD)"
    yield WantedParameter("FS_EKF_ACTION", 1.0, INT8, why)
    why = "the autopilot notices when the people lose their link, and sets HOLD"
    yield WantedParameter("FS_GCS_ENABLE", 1.0, INT8, why, Use.STATION)
    why = "scripts are run: the guard is one (rover-companion guard); counts from the next boot on"
    yield WantedParameter("SCR_ENABLE", 1.0, INT8, why, Use.GUARD)
    why = f"milliseconds of the companion's silence after which the guard stops the rover; {GUARD_MS:g} is usual"
    in_time_ms = 1000.0 * IN_TIME_S
    yield WantedParameter("SCR_USER1", GUARD_MS, REAL32, why, Use.GUARD, Rule.AT_MOST, in_time_ms)
