"""The mission that ``drive`` drives: from a file, on any map, or both; and missions that it refuses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from companion.lidar.spec import LidarSpec
from companion.mission.given import NOTHING_GIVEN, Given, with_given
from companion.mission.load import load_mission
from companion.mission.mission import Mission, MissionError, with_laps
from companion.mission.sensor_tables import is_blind
from sitl.map_mission import field_at, mission_in_world, mission_on_map
from sitl.scenario import Scenario
from sitl.world.world_file import ground_grid


@dataclass(frozen=True, slots=True)
class OnWorld:
    """``--world`` and the options that go with it."""

    world: Path | None
    start: str | None
    target: str | None
    resolution_m: float | None
    top_left: bool
    prior: bool


def mission_to_drive(
    mission_file: Path | None,
    on: OnWorld,
    given: Given = NOTHING_GIVEN,
    *,
    skip_unknown: bool = False,
    laps: int | None = None,
) -> Mission:
    """The mission to drive, from a file, from --world with --start and --target, or from both. Raises MissionError.

    ``given``: what the file does not say; ``skip_unknown``: without what no rover can do; ``laps``: so often.
    """
    mission = with_given(_mission_to_drive(mission_file, on, skip_unknown=skip_unknown), given)
    return with_laps(mission, laps)


def _mission_to_drive(mission_file: Path | None, on: OnWorld, *, skip_unknown: bool) -> Mission:
    world = on.world
    if world is None:
        if mission_file is None:
            raise MissionError("drive: give a MISSION file, or --world MAP with --start X,Y and --target X,Y")
        if on.start or on.target or on.top_left or on.prior:
            raise MissionError("drive: --start, --target, --top-left and --prior go with --world")
        return _driven_here(load_mission(mission_file, skip_unknown=skip_unknown))
    if on.prior and world.suffix.lower() == ".toml":
        raise MissionError(f"drive: --prior: {world} consists of shapes; the companion can read maps only")
    ground = ground_grid(world, on.resolution_m)
    begin = field_at(ground, on.start, "--start", top_left=on.top_left) if on.start else None
    if mission_file is not None:
        if on.target is not None:
            raise MissionError("drive: --target goes with --world alone; the mission has its own targets")
        return mission_in_world(
            _driven_here(load_mission(mission_file, skip_unknown=skip_unknown)), world, ground, begin, prior=on.prior
        )
    if begin is None or on.target is None:
        raise MissionError("drive: --world without a mission needs --start X,Y and --target X,Y")
    end = field_at(ground, on.target, "--target", top_left=on.top_left)
    return mission_on_map(world, ground, begin, end, prior=on.prior)


def _driven_here(mission: Mission) -> Mission:
    """The mission, unless the autopilot drives it in AUTO. Raises MissionError."""
    if mission.in_auto:
        raise MissionError(
            f"{mission.source}: the autopilot drives this mission in AUTO (NAV_GUIDED_ENABLE); "
            "use rover-sitl serve, upload the mission, and rover-companion run"
        )
    return mission


def refuse_blind(mission: Mission, lidars: Sequence[LidarSpec] = ()) -> None:
    """Refuse a mission without range sensors. Raises MissionError."""
    if not lidars and mission.sitl is not None and is_blind(mission.sitl.sensors):
        raise MissionError(
            "sensors none: the companion does not drive without range data; none is for rover-sitl serve"
        )


def refuse_turning_on_the_spot(mission: Mission, scenario: Scenario) -> Scenario:
    """The scenario, unless it has steered wheels that the companion does not know of. Raises MissionError."""
    if scenario.turning_radius_m > 0.0 and mission.rover.turning_radius_m <= 0.0:
        raise MissionError(
            f"{mission.source or mission.name}: the parameters are those of a rover with steered wheels: "
            f"give the mission [rover] turning_radius_m = {scenario.turning_radius_m:g}, "
            "or the companion would turn it on the spot"
        )
    return scenario
