"""Options common to ``drive``, ``serve`` and ``physics``: sensors, parameters, faults."""

from __future__ import annotations

from pathlib import Path

from companion.mission.mission import Mission
from sitl.faults.fault_file import load_faults
from sitl.scenario import Scenario, scenario_from_mission, with_faults, with_parameter_file, with_sensors


def equipped(mission: Mission, sensors: str | None, params: Path | None) -> Mission:
    """The mission with other sensors, and with autopilot parameters from a file. Raises ScenarioError."""
    mission = mission if sensors is None else with_sensors(mission, sensors)
    return mission if params is None else with_parameter_file(mission, params)


def simulated(mission: Mission, faults: Path | None) -> Scenario:
    """The simulation of a mission, with faults. Raises ScenarioError, FaultFileError."""
    return with_faults(scenario_from_mission(mission), load_faults(faults) if faults else None)
