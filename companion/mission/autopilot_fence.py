"""The autopilot's fence as areas, from its stored items and its FENCE parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from companion.core.frames import GeoPoint
from companion.mission.fence_items import FenceAreas, fence_areas
from companion.mission.items import Item
from companion.mission.mission import Area

ENABLE, KINDS, MARGIN, RADIUS, OPTIONS = "FENCE_ENABLE", "FENCE_TYPE", "FENCE_MARGIN", "FENCE_RADIUS", "FENCE_OPTIONS"
PARAMETERS = (ENABLE, KINDS, MARGIN, RADIUS, OPTIONS)
CIRCLE, POLYGON = 2, 4
"""Bits of FENCE_TYPE: the circle round home, and the uploaded areas (which may be circles)."""
UNION = 2
"""Bit of FENCE_OPTIONS: the rover must be inside any one of the inclusion areas, not all."""
DEFAULT_MARGIN_M = 2.0


@dataclass(frozen=True, slots=True)
class AutopilotFence:
    """Where the autopilot lets the rover drive; compared by value.

    ``any_of``: the rover must be inside one of ``keep_in``, otherwise inside all. ``circle_m``: radius of the circle
    round ``home``, None without it. ``margin_m``: distance that the autopilot keeps between border and the rover's
    middle.
    """

    keep_in: tuple[Area, ...] = ()
    keep_out: tuple[Area, ...] = ()
    any_of: bool = False
    circle_m: float | None = None
    home: GeoPoint | None = None
    margin_m: float = 0.0


NO_FENCE = AutopilotFence()


def autopilot_fence(
    items: Sequence[Item], parameters: Mapping[str, float], home: GeoPoint | None, *, enabled: bool
) -> AutopilotFence:
    """The fence in force. ``enabled``: also if FENCE_ENABLE is 0 (a fence can be enabled without that parameter).

    If a firmware lacks one of the parameters, the stored items are assumed to be enforced. Raises ItemError for stored
    items that make no fence.
    """
    if not (enabled or parameters.get(ENABLE, 1.0) > 0.0):
        return NO_FENCE
    kinds = int(parameters.get(KINDS, float(POLYGON)))
    areas = fence_areas(items) if kinds & POLYGON else FenceAreas()
    circle_m = parameters.get(RADIUS) if kinds & CIRCLE else None
    if circle_m is not None and not (math.isfinite(circle_m) and circle_m > 0.0):
        circle_m = None
    if not areas.keep_in and not areas.keep_out and circle_m is None:
        return NO_FENCE
    return AutopilotFence(
        areas.keep_in,
        areas.keep_out,
        any_of=bool(int(parameters.get(OPTIONS, 0.0)) & UNION),
        circle_m=circle_m,
        home=home if circle_m is not None else None,
        margin_m=_margin_m(parameters),
    )


def _margin_m(parameters: Mapping[str, float]) -> float:
    margin_m = parameters.get(MARGIN, DEFAULT_MARGIN_M)
    return margin_m if math.isfinite(margin_m) and margin_m > 0.0 else 0.0
