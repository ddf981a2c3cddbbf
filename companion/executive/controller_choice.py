"""Which controller leads the rover, and with which settings: motions cannot be planned for every rover.

Nouns: controller in force.
"""

from __future__ import annotations

from companion.control.motion_planners import motion_planner
from companion.core.scan import RangeScan
from companion.settings import ControllerKind, Settings
from companion.settings.settings_file import by_points


def controller_in_force(kind: ControllerKind, *, narrow_sight: bool, turning_radius_m: float) -> ControllerKind:
    """What really leads the rover: ``points`` where motions cannot be planned for it.

    Single thin beams leave the ground between them unseen, and a planned motion does not turn to look. The motions
    that are planned begin with turns on the spot, which a rover that turns in arcs cannot do.
    """
    return "points" if narrow_sight or turning_radius_m > 0.0 else kind


def another_controller(asked: ControllerKind, used: ControllerKind, *, narrow_sight: bool) -> str:
    """For people: what leads the rover instead, and why; empty where nothing else does."""
    if used == asked:
        return ""
    why = "single beams see too little" if narrow_sight else "the rover turns in arcs"
    return f"guidance.controller: driving with {used}, not {asked}: {why}"


def settings_in_force(settings: Settings, scan: RangeScan | None, turning_radius_m: float) -> Settings:
    """The settings of the controller in force. ``scan``: any one of the rover's sensor; None: not heard yet."""
    narrow = scan is not None and scan.is_narrow
    return settings_for(settings, narrow_sight=narrow, turning_radius_m=turning_radius_m)


def settings_for(settings: Settings, *, narrow_sight: bool, turning_radius_m: float) -> Settings:
    """The same where it is known whether the rover sees with single thin beams alone."""
    chosen = settings.guidance.controller
    kind = controller_in_force(chosen, narrow_sight=narrow_sight, turning_radius_m=turning_radius_m)
    return settings if kind == chosen else by_points(settings)


def check_controller(kind: ControllerKind) -> None:
    """Raises OwnPartError for a controller of one's own that cannot be used."""
    if kind != "points":
        motion_planner(kind)
