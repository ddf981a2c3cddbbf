"""Tunable settings: those that a ground station may change during a drive, as MAVLink parameters; bounds, their file.

Nouns: tunable settings.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from pydantic import ValidationError

from companion.settings.section import SettingsError
from companion.settings.settings import Settings
from companion.storage.toml_file import read_toml
from companion.storage.validation import describe_first, first_fault

DIGITS = 7
"""Values are sent as 32-bit floats; rounding to 7 digits keeps 0.15 from becoming 0.1500000059."""


class RefusedError(Exception):
    """A value that is refused; the text is the reason in a few words."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A setting as a MAVLink parameter of the companion.

    ``low`` to ``high``: the bounds for ground stations. They are narrower than those of a settings file, so that a
    typing error cannot switch off a watchdog or let the rover drive beyond what it sees: braking much harder than
    measured and a minimum speed above the default are refused. ``next_leg``: it applies from the next leg on, all
    others at once.
    """

    name: str
    section: str
    key: str
    low: float
    high: float
    whole: bool = False
    next_leg: bool = False

    def value(self, settings: Settings) -> float:
        """Its present value."""
        return float(getattr(getattr(settings, self.section), self.key))


TABLE: tuple[Parameter, ...] = (
    Parameter("CMP_SPD_MAX", "guidance", "max_speed_m_s", 0.1, 20.0),
    Parameter("CMP_SPD_MIN", "guidance", "min_speed_m_s", 0.05, 0.5),
    Parameter("CMP_SPD_BEAMS", "guidance", "narrow_speed_m_s", 0.1, 5.0),
    Parameter("CMP_HORIZON", "guidance", "horizon_m", 2.0, 30.0),
    Parameter("CMP_CLEARANCE", "guidance", "clearance_m", 0.0, 2.0),
    Parameter("CMP_SLOW_WITHIN", "guidance", "slow_within_m", 0.1, 5.0),
    Parameter("CMP_DECEL", "guidance", "deceleration_m_s2", 0.1, 1.5),
    Parameter("CMP_BRAKE_DLY", "guidance", "brake_delay_s", 0.2, 2.0),
    Parameter("CMP_LATENCY", "guidance", "latency_s", 0.1, 2.0),
    Parameter("CMP_ARRIVAL", "guidance", "arrival_m", 0.1, 5.0),
    Parameter("CMP_STUCK", "guidance", "stuck_after_s", 2.0, 60.0),
    Parameter("CMP_BACK_OUT", "guidance", "back_out_m", 0.0, 5.0),
    Parameter("CMP_LATERAL", "steering", "lateral_m_s2", 0.1, 5.0),
    Parameter("CMP_BETTER", "navigator", "better_every_fields", 1, 100, whole=True, next_leg=True),
    Parameter("CMP_DOUBTS", "navigator", "doubts", 0, 20, whole=True, next_leg=True),
    Parameter("CMP_WAIT_RETRY", "navigator", "wait_retry_s", 0.5, 60.0),
    Parameter("CMP_WAIT_LIMIT", "navigator", "wait_limit_s", 0.0, 36_000.0),
    Parameter("CMP_YAW_RATE", "mapping", "max_yaw_rate_deg_s", 10.0, 360.0),
    Parameter("CMP_STALE", "safety", "stale_s", 0.3, 3.0),
    Parameter("CMP_HOLD_AFTER", "safety", "hold_after_s", 0.0, 10.0),
    Parameter("CMP_HEARTBEAT", "safety", "heartbeat_s", 1.0, 10.0),
    Parameter("CMP_JUMP", "safety", "jump_m", 0.5, 10.0),
    Parameter("CMP_TRF_LOOK", "traffic", "look_s", 1.0, 60.0),
    Parameter("CMP_TRF_MARGIN", "traffic", "margin_m", 0.0, 5.0),
    Parameter("CMP_TRF_RADIUS", "traffic", "radius_m", 0.1, 10.0),
    Parameter("CMP_TRF_WAIT", "traffic", "patience_s", 5.0, 600.0),
)
"""In the order of their list; new ones are added at the end."""

BY_NAME = {parameter.name: parameter for parameter in TABLE}

SLOWEST, FASTEST = "CMP_SPD_MIN", "CMP_SPD_MAX"


def changed(settings: Settings, parameter: Parameter, value: float) -> Settings:
    """The settings with one parameter changed. Raises RefusedError: not a number, not whole, out of bounds."""
    if not math.isfinite(value):
        raise RefusedError("not a number")
    value = float(f"{value:.{DIGITS}g}")
    if parameter.whole and value != round(value):
        raise RefusedError(f"{value:g} no whole number")
    if not parameter.low <= value <= parameter.high:
        raise RefusedError(f"{value:g} not in {parameter.low:g}..{parameter.high:g}")
    _refuse_crossed(settings, parameter, value)
    section = getattr(settings, parameter.section)
    values = section.model_dump() | {parameter.key: round(value) if parameter.whole else value}
    try:
        return settings.model_copy(update={parameter.section: type(section).model_validate(values)})
    except ValidationError as error:
        raise RefusedError(first_fault(error)[1]) from error


def _refuse_crossed(settings: Settings, parameter: Parameter, value: float) -> None:
    """Refuses a minimum speed above the maximum speed."""
    if parameter.name == SLOWEST and value > (fastest := BY_NAME[FASTEST].value(settings)):
        raise RefusedError(f"{value:g} above {FASTEST} {fastest:g}")
    if parameter.name == FASTEST and value < (slowest := BY_NAME[SLOWEST].value(settings)):
        raise RefusedError(f"{value:g} below {SLOWEST} {slowest:g}")


def as_toml(base: Settings, tuned: Settings) -> str:
    """The changes by ground stations as a settings file, whose lines people may copy into their own."""
    lines = ["# Set from a ground station; counts after the settings file."]
    sections: dict[str, list[str]] = {}
    for parameter in TABLE:
        value = parameter.value(tuned)
        if value != parameter.value(base):
            text = str(round(value)) if parameter.whole else repr(value)
            sections.setdefault(parameter.section, []).append(f"{parameter.key} = {text}  # {parameter.name}")
    for section, entries in sections.items():
        lines += ["", f"[{section}]", *entries]
    return "\n".join([*lines, ""])


def with_tuned(base: Settings, path: Path) -> Settings:
    """The settings with the changes in a file that ``as_toml`` wrote, within the same bounds; no file changes nothing.

    Raises SettingsError (one line: file, place, reason, remedy).
    """
    remedy = "put it right, or delete it to go back to the settings file"
    saved = read_toml(path, SettingsError, remedy=remedy, name_it="make it readable", missing_ok=True)
    if not saved:
        return base
    values = base.model_dump()
    for section, entries in saved.items():
        inside = values.get(section)
        values[section] = inside | entries if isinstance(inside, dict) and isinstance(entries, dict) else entries
    try:
        tuned = Settings.model_validate(values)
    except ValidationError as error:
        raise SettingsError(f"{path}: {describe_first(error, Settings)}; {remedy}") from error
    for parameter in TABLE:
        value, inside = parameter.value(tuned), saved.get(parameter.section)
        if isinstance(inside, dict) and parameter.key in inside and not parameter.low <= value <= parameter.high:
            place, bounds = f"{parameter.section}.{parameter.key}", f"{parameter.low:g}..{parameter.high:g}"
            raise SettingsError(f"{path}: {place}: {value:g} not in {bounds} ({parameter.name}); {remedy}")
    return tuned


def differences(base: Settings, tuned: Settings) -> list[str]:
    """The changed settings in words."""
    return [
        f"{parameter.name} {parameter.value(tuned):g} (settings file: {parameter.value(base):g})"
        for parameter in TABLE
        if parameter.value(tuned) != parameter.value(base)
    ]
