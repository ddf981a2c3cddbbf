"""Settings read from a TOML file."""

from __future__ import annotations

from pathlib import Path

from pydantic import ValidationError

from companion.settings.section import SettingsError
from companion.settings.settings import MappingSettings, Settings
from companion.storage.toml_file import read_toml
from companion.storage.validation import describe_first

MAX_BYTES = 1_000_000

FOR_PLANNED_MOTIONS: dict[str, dict[str, object]] = {
    "mapping": {"evidence_m": 0.1, "hit_depth_m": 0.02, "keeps": "outline"},
    "link": {"range_rate_hz": 20.0, "position_rate_hz": 20.0},
}
"""Other defaults, with any controller but ``points``."""


def load_settings(path: Path | None) -> Settings:
    """Read a TOML settings file; None gives the defaults.

    Raises SettingsError: one line with file, place and reason; for an unknown key, with the nearest known key or all of
    them.
    """
    if path is None:
        return Settings()
    data = read_toml(path, SettingsError, name_it="name a TOML file, or leave --settings out", limit=MAX_BYTES)
    return parse_settings(data, str(path))


def parse_settings(data: dict[str, object], source: str) -> Settings:
    """Settings from parsed TOML. Raises SettingsError naming ``source``."""
    if data.get("profile") == "paper":
        navigator = data.setdefault("navigator", {})
        if isinstance(navigator, dict):
            navigator.setdefault("planner", "bspline-ga")
    guidance = data.get("guidance")
    if isinstance(guidance, dict) and guidance.get("controller", "points") != "points":
        _set_for_planned_motions(data)
    try:
        return Settings.model_validate(data)
    except ValidationError as error:
        raise SettingsError(f"{source}: {describe_first(error, Settings)}") from error


def by_points(settings: Settings) -> Settings:
    """The same as if ``guidance.controller`` were ``points``: what planned motions have other defaults for, too."""
    usual, given = MappingSettings(), settings.mapping
    back = {
        name: getattr(usual, name)
        for name, value in FOR_PLANNED_MOTIONS["mapping"].items()
        if getattr(given, name) == value
    }
    guidance = settings.guidance.model_copy(update={"controller": "points"})
    return settings.model_copy(update={"guidance": guidance, "mapping": given.model_copy(update=back)})


def _set_for_planned_motions(data: dict[str, object]) -> None:
    """Planned motions need a fine map and frequent data, where the file says nothing else."""
    for section, values in FOR_PLANNED_MOTIONS.items():
        table = data.setdefault(section, {})
        if isinstance(table, dict):
            for name, value in values.items():
                table.setdefault(name, value)
