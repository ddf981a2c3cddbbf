"""Settings of the companion: every setting with default, unit and meaning; settings files; MAVLink parameters."""

from companion.settings.planners import PlannerSettings
from companion.settings.section import Section, SettingsError
from companion.settings.settings import (
    CONTROLLERS,
    ControllerKind,
    FenceSettings,
    GuidanceSettings,
    LinkSettings,
    MappingSettings,
    MotionSettings,
    NavigatorSettings,
    PowerSettings,
    SafetySettings,
    SearchSettings,
    Settings,
    SteeringSettings,
    TrafficSettings,
)
from companion.settings.settings_file import load_settings, parse_settings

__all__ = [
    "CONTROLLERS",
    "ControllerKind",
    "FenceSettings",
    "GuidanceSettings",
    "LinkSettings",
    "MappingSettings",
    "MotionSettings",
    "NavigatorSettings",
    "PlannerSettings",
    "PowerSettings",
    "SafetySettings",
    "SearchSettings",
    "Section",
    "Settings",
    "SettingsError",
    "SteeringSettings",
    "TrafficSettings",
    "load_settings",
    "parse_settings",
]
