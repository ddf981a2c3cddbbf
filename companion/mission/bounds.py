"""Borders of the mission's and the autopilot's fences: which fields they close, and which lines cross them.

The planner uses the closed fields. Before a target is sent, the line to it is checked with the exact shapes.

Nouns: bounds.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import shapely
from shapely.geometry.base import BaseGeometry

from companion.core.frames import LocalFrame, NedPoint
from companion.core.grid import Cell, Grid
from companion.mission.areas import CIRCLE_QUARTER, Mask, Places, covered, middles_in, shape_of, touched
from companion.mission.autopilot_fence import AutopilotFence
from companion.mission.mission import Area, Mission

SLACK_M = 0.05
"""How much nearer to a border than planned the rover may come: positions are noisy."""
NEARER_M = 0.01
"""A rover that is too near must not come nearer; less than this does not count."""
ROUND = 1.0 / math.cos(math.pi / (4 * CIRCLE_QUARTER))
"""The factor by which a polygon must grow to contain the circle that its corners lie on."""


@dataclass(frozen=True, eq=False, slots=True)
class Bound:
    """One border. ``shape``: x metres east, y metres north in the local frame.

    ``keep_m``: the distance that plans keep between it and the rover's middle; ``body_m``: the distance that is never
    undercut. ``in_fields``: it was given in fields, and applies to whole fields.
    """

    name: str
    shape: BaseGeometry
    keeps_in: bool
    keep_m: float
    body_m: float
    in_fields: bool = False
    of_autopilot: bool = False
    """It is of the autopilot's fence, which may change during the drive."""

    def closed(self, grid: Grid) -> Mask:
        """The fields that the rover's middle must not enter; shape (height, width)."""
        if self.keeps_in:
            return ~(middles_in(grid, self.shape) if self.in_fields else covered(grid, self.shape.buffer(-self.keep_m)))
        return touched(grid, self.shape if self.in_fields else self.shape.buffer(self.keep_m))

    def depth_m(self, place: BaseGeometry) -> float:
        """The smallest distance of a point or line from the border; 0 or less when it touches or crosses it."""
        edge_m = float(shapely.distance(self.shape.boundary, place))
        inside = shapely.covers(self.shape, place) if self.keeps_in else not shapely.intersects(self.shape, place)
        return edge_m if inside else -edge_m


class Bounds:
    """All borders. ``fault`` and ``outside`` are fast (microseconds a border) for places well inside."""

    def __init__(self, bounds: Sequence[Bound] = (), resolution_m: float = 1.0) -> None:
        """``resolution_m``: side of the fields in which some borders were given."""
        self._bounds = tuple(_widened(bound, resolution_m) for bound in bounds)
        self._roomy = tuple(_roomy(bound) for bound in self._bounds)

    def __len__(self) -> int:
        """How many borders there are."""
        return len(self._bounds)

    def __iter__(self) -> Iterator[Bound]:
        """Each border."""
        return iter(self._bounds)

    def outside(self, point: NedPoint) -> str:
        """The name of the border that the rover's middle has crossed; empty if none."""
        if not self._bounds:
            return ""
        place = shapely.Point(point.east_m, point.north_m)
        return next((bound.name for bound in self._near(place) if bound.depth_m(place) <= 0.0), "")

    def too_near(self, point: NedPoint) -> str:
        """For a rover that is to start here: what a border that is too near requires; empty if none is."""
        place = shapely.Point(point.east_m, point.north_m)
        for bound in self._bounds:
            if bound.depth_m(place) < bound.keep_m - SLACK_M:
                side = "inside" if bound.keeps_in else "away from"
                return f"{bound.keep_m:g} m or more {side} {bound.name}"
        return ""

    def fault(self, points: Sequence[NedPoint]) -> str:
        """The name of the border that the rover's body would cross along the line through the points; empty if none.

        A rover that is already too near may move if it comes no nearer and its middle does not cross the border.
        """
        places = [_place(point) for point in points]
        way, here = shapely.LineString(places), shapely.Point(places[0])
        for bound in self._near(way):
            depth_m = bound.depth_m(way)
            least_m = min(bound.body_m - SLACK_M, bound.depth_m(here) - NEARER_M)
            if not (depth_m > 0.0 and depth_m >= least_m):
                return bound.name
        return ""

    def _near(self, shape: BaseGeometry) -> Iterator[Bound]:
        """The borders that need an exact check."""
        for bound, roomy in zip(self._bounds, self._roomy, strict=True):
            free = roomy.covers(shape) if bound.keeps_in else not roomy.intersects(shape)
            if not free:
                yield bound


def mission_bounds(mission: Mission, places: Places) -> list[Bound]:
    """The borders of the mission's fences, in its order."""
    body_m = mission.rover.radius_m
    bounds = []
    for keeps_in, areas in ((False, mission.keep_out), (True, mission.keep_in)):
        for number, area in enumerate(areas, start=1):
            in_fields = _in_fields(area)
            room_m = 0.0 if in_fields else body_m
            name = f"{'keep_in' if keeps_in else 'keep_out'} {number}"
            bounds.append(Bound(name, _sound(shape_of(area, places)), keeps_in, room_m, room_m, in_fields))
    return bounds


def autopilot_bounds(fence: AutopilotFence, frame: LocalFrame, body_m: float) -> list[Bound]:
    """The borders of the autopilot's fence, with the larger of its margin and the rover's radius."""
    places = Places(frame, NedPoint(0.0, 0.0), _no_fields)
    keep_m = max(fence.margin_m, body_m)
    borders: list[tuple[str, BaseGeometry, bool]] = []
    for number, area in enumerate(fence.keep_out, start=1):
        grown = Area(area.places, None if area.radius_m is None else area.radius_m * ROUND)
        borders.append((f"exclusion area {number}", _sound(shape_of(grown, places)), False))
    inside = [_sound(shape_of(area, places)) for area in fence.keep_in]
    if fence.any_of and len(inside) > 1:
        borders.append(("inclusion areas", shapely.union_all(inside), True))
    else:
        borders += [(f"inclusion area {number}", shape, True) for number, shape in enumerate(inside, start=1)]
    if fence.circle_m is not None and fence.home is not None:
        circle = shape_of(Area((fence.home,), fence.circle_m), places)
        borders.append((f"circle of {fence.circle_m:g} m round home", circle, True))
    return [
        Bound(f"the autopilot's fence ({which})", shape, keeps_in, keep_m, body_m, of_autopilot=True)
        for which, shape, keeps_in in borders
    ]


def _place(point: NedPoint) -> tuple[float, float]:
    """East and north, to a micrometre: shapely gives no distance for lengths whose square underflows."""
    return round(point.east_m, 6), round(point.north_m, 6)


def _in_fields(area: Area) -> bool:
    """Whether an area is a polygon given in fields: it includes its corner fields."""
    return area.radius_m is None and area.width_m is None and all(isinstance(place, Cell) for place in area.places)


def _no_fields(cell: Cell) -> NedPoint:
    raise AssertionError(f"the autopilot knows no fields ({cell})")


def _sound(shape: BaseGeometry) -> BaseGeometry:
    """The area that a polygon encloses, even if its sides cross."""
    if shape.is_valid:
        return shape
    polygons = shapely.get_parts(shapely.make_valid(shape))
    return shapely.union_all([polygon for polygon in polygons if polygon.geom_type in ("Polygon", "MultiPolygon")])


def _widened(bound: Bound, resolution_m: float) -> Bound:
    """A keep-in border given in fields, moved out from the middles of its corner fields to their edges."""
    if not bound.in_fields or not bound.keeps_in:
        return bound
    shape = bound.shape.buffer(resolution_m / 2.0, join_style="mitre")
    return replace(bound, shape=shape)


def _roomy(bound: Bound) -> BaseGeometry:
    """A shape for the fast check: entirely inside it (keep-in) or apart from it (keep-out) no exact check is needed."""
    shape = bound.shape.buffer(-bound.keep_m if bound.keeps_in else bound.keep_m)
    shapely.prepare(shape)
    return shape
