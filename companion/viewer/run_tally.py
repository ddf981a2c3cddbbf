"""The run tally: what is counted of a run while it is made again, for tables and to compare runs.

Nouns: run tally.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field

from companion.app import Companion
from companion.core.frames import NedPoint
from companion.executive.mission_progress import TargetStatus
from companion.navigation.field_step import Decision
from companion.replay.replay import ReplayObserver
from companion.safety.reasons import Doubt, RunPhase, WaitReason
from companion.viewer.energy import EnergyMeter
from companion.viewer.frame import doing_of
from companion.viewer.headway import Headway
from companion.viewer.steady_frame import SteadyFrame

MOVES_M_S = 0.05
"""A slower rover stands."""
OLD_S = 1.0
"""A speed that was heard longer ago says nothing of now."""
STOOD = ("stopped", "waiting")
TRACK_S = 0.4


@dataclass
class Spell:
    """How often something was so, for how long in all, and when for the first time."""

    times: int = 0
    seconds: float = 0.0
    first_s: float = 0.0


@dataclass
class Leg:
    """The way to one target, in the lap that was begun last.

    ``ended_s``: when it was reached, skipped or found unreachable; None until then. ``straight_m``: from where the leg
    began, of a target that was reached.
    """

    name: str
    status: TargetStatus
    ended_s: float | None = None
    driven_m: float | None = None
    straight_m: float | None = None


@dataclass
class _Spells:
    """Spells by their names; only one lasts at a time."""

    found: dict[str, Spell] = field(default_factory=lambda: defaultdict(Spell))
    lasting: str = ""

    def note(self, name: str, time_s: float, step_s: float) -> None:
        """What is so now; empty for nothing."""
        if name:
            spell = self.found[name]
            if name != self.lasting:
                spell.first_s = spell.first_s if spell.times else time_s
                spell.times += 1
            spell.seconds += step_s
        self.lasting = name


class RunTally(ReplayObserver):
    """Counts during a replay."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self.driven_m = self.backwards_m = self.moving_s = 0.0
        self.decisions = self.searches = 0
        self.stops = 0
        self.stopped_s = 0.0
        self.legs: list[Leg] = []
        self.energy = EnergyMeter()
        self.track: list[tuple[float, float, float]] = []
        """Time, north and east of the run's first origin."""
        self._steady = SteadyFrame()
        self._stood, self._doubted = _Spells(), _Spells()
        self._headway = Headway()
        self._stopped = False
        self._leg_from_m = 0.0
        self._leg_from: NedPoint | None = None

    @property
    def stood(self) -> dict[str, Spell]:
        """Stops, waits and what held up a rover that was led, by their reasons."""
        return self._stood.found

    @property
    def watchdogs(self) -> dict[str, Spell]:
        """Doubts that kept the rover from moving."""
        return self._doubted.found

    @property
    def reached(self) -> int:
        """Targets reached."""
        return sum(leg.status is TargetStatus.REACHED for leg in self.legs)

    def decided(self, companion: Companion, number: int, time_s: float, target: str, decision: Decision) -> None:
        """See ``ReplayObserver``."""
        self.decisions += 1

    def ticked(self, companion: Companion, time_s: float) -> None:
        """See ``ReplayObserver``."""
        step_s, self.seconds = time_s - self.seconds, time_s
        vehicle = companion.vehicle
        position = vehicle.position
        is_heard = position is not None and companion.status().time_s - position.time_s <= OLD_S
        if vehicle.speed_m_s > MOVES_M_S and is_heard:
            self.driven_m += vehicle.speed_m_s * step_s
            self.moving_s += step_s
            self.backwards_m += max(-vehicle.forward_m_s, 0.0) * step_s
        self.energy.take(vehicle.battery)
        self._headway.note(companion, companion.status())
        self._note_stop(companion, time_s, step_s)
        places, pose = companion.mission_run.places, companion.status().pose
        self._steady.note(None if places is None else places.origin)
        here = None if pose is None else self._steady.point(pose.point)
        if here is not None and (not self.track or time_s - self.track[-1][0] >= TRACK_S - 1e-6):
            self.track.append((round(time_s, 2), round(here.north_m, 2), round(here.east_m, 2)))
        self._note_legs(companion, time_s, here)
        if companion.driver is not None:
            self.searches = len(companion.driver.searcher.seconds)

    def _note_stop(self, companion: Companion, time_s: float, step_s: float) -> None:
        # As the large line has it. What is awaited may change while the rover stands for one reason: that is one stop.
        doing, phase = doing_of(companion, companion.status(), self._headway), companion.mission_run.activity.phase
        hindrance = self._headway.hindrance
        held_up = "" if hindrance is None else hindrance.value
        name = doing["line"].replace("stopping: ", "stopped: ", 1)
        stood = doing["state"] in STOOD and not self._headway.stands_for_others  # which is no hindrance for a moment
        self._stood.note(held_up or (name if stood else ""), time_s, step_s)
        self._doubted.note(_doubt(companion), time_s, step_s)
        stopped = doing["state"] == "stopped" or phase is RunPhase.WAY_BLOCKED
        self.stops += stopped and not self._stopped
        self.stopped_s += step_s if stopped else 0.0
        self._stopped = stopped

    def _note_legs(self, companion: Companion, time_s: float, point: NedPoint | None) -> None:
        """What has become of the targets. A leg begins where the rover is first led, or where the last one ended."""
        if self._leg_from is None and companion.mission_run.is_driving:
            self._leg_from, self._leg_from_m = point, self.driven_m
        statuses = companion.statuses()
        if len(self.legs) != len(statuses):
            self.legs = [Leg(name, status) for name, status in statuses]
        for number, (name, status) in enumerate(statuses):
            if status is self.legs[number].status:
                continue
            leg = self.legs[number] = Leg(name, status)
            if status is TargetStatus.PENDING:
                continue  # another lap
            leg.ended_s, leg.driven_m = time_s, self.driven_m - self._leg_from_m
            if status is TargetStatus.REACHED and point is not None and self._leg_from is not None:
                leg.straight_m = self._leg_from.distance_m(point)
            self._leg_from, self._leg_from_m = point, self.driven_m


def _doubt(companion: Companion) -> str:
    """What keeps the rover from moving as a watchdog has it, also while somebody else has it; empty for nothing."""
    stop, awaited = companion.mission_run.stop, companion.mission_run.activity.awaited
    if awaited is not None and awaited.kind is WaitReason.GOOD_DATA_AND:
        return str(awaited.figures[0])
    reason = None if stop is None else stop.reason
    return str(reason) if reason is not None and isinstance(reason.kind, Doubt) else ""
