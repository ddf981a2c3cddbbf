"""What a controller sees of one moment: pose, speed, map, the rover's limits and the settings in force.

Nouns: local view.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from companion.control.following import AS_SHIPPED, Following
from companion.control.told import Told
from companion.core.changed import changed
from companion.core.footprint import Footprint
from companion.core.frames import Pose
from companion.core.rover_limits import RoverLimits
from companion.mapping.evidence_map import EvidenceMap
from companion.settings import Settings
from companion.vehicle.commands import GuidedPosition, Setpoint

MOST_FURTHER_M = 3.0
"""No rover shoots farther: its throttle closes meanwhile."""
DRAGS_M_S, DRAGS_SHARE = 0.4, 0.5
"""Ground may drag a rover that is held by so much, and by such a share of its own speed. Less may be a rover that
gathers speed, or whose throttle says something else than the companion was told."""


@dataclass(frozen=True, eq=False)
class LocalView:
    """One moment, local frame. ``speed_m_s``: over ground, without a sign; ``yaw_rate_rad_s``: clockwise positive.

    ``told``: the setpoint of the tick before; None where there was none. ``lately``: the velocities told before.
    ``placed_s``: when a position was told last, and the autopilot drives to it by up to ``placed_m_s``; inf where that
    is not known.
    ``held_m_s``: so much slower than its throttle would let it go on firm ground; ``dragged_m_s``: and for some time,
    0 where that may have another reason. ``lately_held``: its throttle and steering may still be open from that, see
    ``drag``. ``rolls_back``: it moves tail first.
    ``following``: how it follows velocities, as far as is known; over a late link it may obey after ``soonest_s``, too.
    ``body``: its outline, if it is no circle.
    ``scans``: so many have been taken into the map.
    """

    pose: Pose
    speed_m_s: float
    evidence: EvidenceMap
    rover: RoverLimits
    settings: Settings
    yaw_rate_rad_s: float = 0.0
    held_m_s: float = 0.0
    dragged_m_s: float = 0.0
    lately_held: bool = False
    told: Setpoint | None = None
    lately: Told = ()
    placed_s: float = -math.inf
    placed_m_s: float = math.inf
    rolls_back: bool = False
    following: Following = AS_SHIPPED
    soonest_s: float = math.inf
    body: Footprint | None = None
    scans: int = 0

    @property
    def footprint(self) -> Footprint:
        """The rover's outline."""
        return self.body or Footprint.circle(self.rover.radius_m)

    @property
    def forward_m_s(self) -> float:
        """Its speed, below 0 if it rolls tail first."""
        return -self.speed_m_s if self.rolls_back else self.speed_m_s

    @property
    def shoots_m_s(self) -> float:
        """How fast it goes forwards, below 0 back, if the ground that drags it ends now."""
        return self.forward_m_s + math.copysign(self.dragged_m_s, self.forward_m_s)

    def by_position(self, time_s: float) -> bool:
        """Whether a position was in force then."""
        return isinstance(self.told, GuidedPosition) or time_s <= self.placed_s

    @property
    def may_be_dragged(self) -> bool:
        """Whether the ground seems to drag it, or it gathers speed."""
        return is_held_much(self.held_m_s, self.speed_m_s)

    @property
    def further_m(self) -> float:
        """So much farther than usual the rover may go before it stands: where ground ends that holds it."""
        return min(self.settings.guidance.held_overshoot_s * self.held_m_s, MOST_FURTHER_M)

    def with_speeds(self, cruise_speed_m_s: float, fastest_m_s: float) -> LocalView:
        """The same moment with another cruise speed, and with the highest speed that is ever told on this way."""
        return changed(self, rover=changed(self.rover, cruise_speed_m_s=cruise_speed_m_s, fastest_m_s=fastest_m_s))


def is_held_much(held_m_s: float, speed_m_s: float) -> bool:
    """Whether ground that drags a rover of this speed would hold it by so much."""
    return held_m_s >= max(DRAGS_M_S, DRAGS_SHARE * speed_m_s)
