"""The autopilot's own fence as plain values: what its stored items and its parameters say together."""

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
"""Bits of FENCE_TYPE: the circle round home, and the areas that were uploaded (circles among them)."""
UNION = 2
"""Bit of FENCE_OPTIONS: being inside any one of the inclusion areas is enough."""
DEFAULT_MARGIN_M = 2.0


@dataclass(frozen=True, slots=True)
class AutopilotFence:
    """Where the autopilot lets the rover drive. Compared by value: another fence is another value.

    ``any_of``: inside one of ``keep_in`` is enough, otherwise it must be inside all. ``circle_m``: radius of the circle round
    ``home``, None without it. ``margin_m``: how far from the border the autopilot wants the rover's middle to stay.
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
    """The fence in force. ``enabled``: heed it even where FENCE_ENABLE is 0 (it can be switched on without that parameter).

    A firmware without one of the parameters is taken for one that enforces what is stored. Raises ItemError for stored items
    that make no fence.
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
