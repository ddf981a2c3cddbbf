"""What the command line says of a mission whose file cannot: the size of fields and rover, and the speed."""

from __future__ import annotations

from dataclasses import dataclass, replace

from companion.mission.mission import Mission, MissionError

INSTEAD = {
    "--resolution-m": "[grid] resolution_m",
    "--radius-m": "[rover] radius_m",
    "--speed": "[rover] cruise_speed_m_s",
}
"""The options, and what a TOML mission says instead."""


@dataclass(frozen=True, slots=True)
class Given:
    """The options; None where one was not given."""

    resolution_m: float | None = None
    radius_m: float | None = None
    speed_m_s: float | None = None

    @property
    def options(self) -> tuple[str, ...]:
        """The names of those that were given."""
        values = zip(INSTEAD, (self.resolution_m, self.radius_m, self.speed_m_s), strict=True)
        return tuple(name for name, value in values if value is not None)


NOTHING_GIVEN = Given()


def with_given(mission: Mission, given: Given) -> Mission:
    """The mission with these values.

    Raises MissionError for a TOML mission, which says them itself: a size that stands in two places is soon wrong in
    one of them.
    """
    if given.options and mission.source is not None and mission.source.suffix.lower() == ".toml":
        option = given.options[0]
        raise MissionError(f"{mission.source}: {option}: a TOML mission says this itself: {INSTEAD[option]}")
    grid, rover = mission.grid, mission.rover
    if given.resolution_m is not None:
        grid = replace(grid, resolution_m=given.resolution_m, by_footprint=False)
    if given.radius_m is not None:
        rover = replace(rover, radius_m=given.radius_m)
    if given.speed_m_s is not None:
        rover = replace(rover, cruise_speed_m_s=given.speed_m_s)
    return replace(mission, grid=grid, rover=rover)
