"""The mission laid out on the ground: once when it begins, and again whenever the autopilot moves the origin of its local frame."""

from __future__ import annotations

from dataclasses import dataclass, replace

from companion.frames import GeoPoint, LocalFrame, NedPoint, Pose
from companion.grid import Grid, inflated
from companion.itinerary import Itinerary, plan_itinerary, relaid
from companion.mapping import EvidenceMap, new_map
from companion.mission.mission import Mission, OnBlocked
from companion.mission.resolve import ResolvedTarget, resolve
from companion.settings import MappingSettings


@dataclass(frozen=True, eq=False, slots=True)
class Laid:
    """Where the mission lies. ``home`` is the place its metres and fields count from: home as it was when the mission began."""

    origin: GeoPoint
    home: GeoPoint
    evidence: EvidenceMap
    itinerary: Itinerary


def lay(mission: Mission, settings: MappingSettings, origin: GeoPoint, home: GeoPoint, pose: Pose) -> Laid:
    """Lay the mission out; the rover returns to ``pose`` when it has to. Raises MissionError."""
    frame = LocalFrame(origin)
    resolved = resolve(mission, frame, frame.to_ned(home))
    start = _start(pose.point, resolved.grid)
    evidence = _fresh_map(mission, settings, resolved.grid)
    return Laid(origin, home, evidence, plan_itinerary(resolved.targets, start))


def lay_again(laid: Laid, itinerary: Itinerary, mission: Mission, settings: MappingSettings, origin: GeoPoint) -> Laid:
    """The same places on earth in a local frame with another origin, and an empty map. Raises MissionError."""
    frame = LocalFrame(origin)
    resolved = resolve(mission, frame, frame.to_ned(laid.home))
    before = LocalFrame(laid.origin)
    start = frame.to_ned(before.to_geo(itinerary.home.point))
    errand = itinerary.errand
    if errand is not None:
        point = frame.to_ned(before.to_geo(errand.point))
        errand = replace(errand, point=point, cell=resolved.grid.cell_at(point))
    evidence = _fresh_map(mission, settings, resolved.grid)
    relaid_itinerary = relaid(itinerary, resolved.targets, _start(start, resolved.grid), errand)
    return Laid(origin, laid.home, evidence, relaid_itinerary)


def from_home(laid: Laid) -> Grid:
    """The map as it is, with its place in metres from home: what ``prior_map`` expects of a saved map."""
    grid = laid.evidence.grid
    home, corner = LocalFrame(laid.origin).to_ned(laid.home), grid.south_west
    return Grid(grid.weights, grid.resolution_m, NedPoint(corner.north_m - home.north_m, corner.east_m - home.east_m))


def apart_m(here: GeoPoint, there: GeoPoint) -> float:
    """Metres between two places that are near each other."""
    return LocalFrame(here).to_ned(there).distance_m(NedPoint(0.0, 0.0))


def _start(point: NedPoint, grid: Grid) -> ResolvedTarget:
    return ResolvedTarget("start", point, grid.cell_at(point), 0.0, OnBlocked.HOLD, None)


def _fresh_map(mission: Mission, settings: MappingSettings, grid: Grid) -> EvidenceMap:
    """Fences and known ground grow by the rover's radius; what is seen is measured against the radius itself."""
    radius_m = mission.rover.radius_m
    return new_map(grid.with_weights(inflated(grid.weights, radius_m / grid.resolution_m)), radius_m, settings)
