"""Every setting of the companion, with its default, unit and meaning, and the file they are read from."""

from companion.settings.planners import PlannerSettings
from companion.settings.section import Section, SettingsError, alike
from companion.settings.settings import (
    FenceSettings,
    GuidanceSettings,
    LinkSettings,
    MappingSettings,
    NavigatorSettings,
    PowerSettings,
    SafetySettings,
    SearchSettings,
    Settings,
    SteeringSettings,
    TrafficSettings,
)
from companion.settings.settings_file import describe_first, load_settings, parse_settings

__all__ = [
    "FenceSettings",
    "GuidanceSettings",
    "LinkSettings",
    "MappingSettings",
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
    "alike",
    "describe_first",
    "load_settings",
    "parse_settings",
]
