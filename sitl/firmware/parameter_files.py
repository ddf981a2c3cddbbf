"""Reads parameter files of Mission Planner (NAME,VALUE), MAVProxy (NAME VALUE) and QGroundControl (five columns).

Nouns: parameter file.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from companion.storage.files import read_at_most
from sitl.autopilot.control.servo_outputs import (
    GROUND_STEERING,
    THROTTLE,
    THROTTLE_LEFT,
    THROTTLE_RIGHT,
    functions_of,
    is_skid,
)
from sitl.autopilot.parameters import DEFAULTS, INT8, INT16, INT32, REAL32
from sitl.firmware.parameter_ranges import outside

NAME = re.compile(r"[A-Z][A-Z0-9_]{0,15}")
AUTOPILOT = 1
"""Component to which a rover's parameters belong; QGroundControl's files may contain those of others as well."""
TYPES = (INT8, INT16, INT32, REAL32)
MOST_BYTES = 1_000_000
NAMES_TOLD = 5
LARGEST = 3.4e38
"""Largest 32-bit float."""
COUNTS = frozenset({"FENCE_TOTAL", "MIS_TOTAL", "RALLY_TOTAL"})
"""Set by the autopilot itself; values in a file are ignored."""


class ParameterFileError(Exception):
    """A parameter file that cannot be used; the text is one line with file, line, reason and remedy."""


@dataclass(frozen=True, slots=True)
class ParameterFile:
    """Contents of a parameter file.

    ``values``: by name, the last of several counts; ``types``: MAV_PARAM_TYPE, where given; ``others``: number of
    lines for other components.
    """

    path: Path
    values: dict[str, float]
    types: dict[str, int]
    others: int = 0
    repeated: tuple[str, ...] = ()
    """Names that occur more than once with different values."""

    @property
    def known(self) -> dict[str, float]:
        """The parameters that the simulator knows."""
        return {name: value for name, value in self.values.items() if name in DEFAULTS.keys() - COUNTS}

    @property
    def unknown(self) -> dict[str, float]:
        """The parameters that it only stores."""
        return {name: value for name, value in self.values.items() if name not in DEFAULTS}

    @property
    def is_skid(self) -> bool:
        """Whether the outputs are those of a rover with skid steering."""
        return is_skid(self.values)

    @property
    def is_steered(self) -> bool:
        """Whether the outputs are those of a rover with steered wheels and one throttle."""
        return not self.is_skid and {GROUND_STEERING, THROTTLE} <= functions_of(self.values)

    def notes(self, steered: bool) -> tuple[str, ...]:
        """Remarks about this file for the simulated plant, one line each; ``steered``: the plant has steered wheels."""
        wired = {1: GROUND_STEERING, 3: THROTTLE} if steered else {1: THROTTLE_LEFT, 3: THROTTLE_RIGHT}
        odd = [
            f"SERVO{n}_FUNCTION {self.values[f'SERVO{n}_FUNCTION']:g}"
            for n, function in wired.items()
            if self.values.get(f"SERVO{n}_FUNCTION", function) != function
        ]
        odd += [f"SERVO{n}_REVERSED 1" for n in wired if self.values.get(f"SERVO{n}_REVERSED", 0.0)]
        motors = f"{wired[1]} on output 1 and {wired[3]} on output 3"
        wired_as = f"the simulated motors are wired as {motors}, not reversed; it will drive wrongly"
        wrong = f"{self.path}: {', '.join(odd)}: {wired_as}"
        return (*(text for text in (self.note(),) if text), *self.likely_mistakes, *((wrong,) if odd else ()))

    def firmware_notes(self, written: Mapping[str, float] | None, recommended: Mapping[str, float]) -> tuple[str, ...]:
        """Remarks about this file for the real firmware, one line each.

        ``written``: all parameters written for the firmware; None if none are. ``recommended``: what the companion
        wants.
        """
        if written is None:
            only = (
                "used only for the kind of steering; --write-params FILE writes the other parameters for the firmware"
            )
            return (f"{self.path}: {only}", *self.likely_mistakes)
        changed = tuple(
            f"{self.path}: {name} {value:g} becomes {written[name]:g}, as the simulated rover is built"
            for name, value in self.values.items()
            if written.get(name, value) != value
        )
        unknown = list(self.unknown)
        passed = f"{self.path}: unknown and passed on unchanged: {_some(unknown)}"
        unwanted = tuple(
            f"{self.path}: {name} {self.values[name]:g}: the companion wants {wanted:g} (see rover-companion doctor)"
            for name, wanted in recommended.items()
            if self.values.get(name, wanted) != wanted
        )
        return (*self.likely_mistakes, *changed, *unwanted, *((passed,) if unknown else ()))

    @property
    def likely_mistakes(self) -> tuple[str, ...]:
        """Likely mistakes in the file, one line each."""
        limits = outside(self.values)
        twice = f"{self.path}: {_some(self.repeated)}: given more than once; the last value counts"
        odd = f"{self.path}: outside the range that ArduRover documents: {_some(limits)}; is that intended?"
        return (*((twice,) if self.repeated else ()), *((odd,) if limits else ()))

    def note(self) -> str:
        """One line about parameters that are stored without effect; empty if there are none."""
        names = list(self.unknown)
        if not names:
            return ""
        count = f"{len(names)} of {len(self.values)} parameters are not simulated and only stored to be read back"
        return f"{self.path}: {count}: {_some(names)}"


def _some(names: Sequence[str]) -> str:
    """The first few names."""
    return ", ".join(names[:NAMES_TOLD]) + (", ..." if len(names) > NAMES_TOLD else "")


def load_parameters(path: Path) -> ParameterFile:
    """Read a parameter file. Raises ParameterFileError."""
    try:
        text = read_at_most(path, MOST_BYTES).decode("utf-8-sig")
    except OSError as error:
        raise ParameterFileError(f"{path}: cannot be read: {error.strerror or error}; check the name") from error
    except UnicodeDecodeError as error:
        raise ParameterFileError(f"{path}: not UTF-8 text (byte {error.start}); is it another file?") from error
    return _read(path, text)


def _read(path: Path, text: str) -> ParameterFile:
    values: dict[str, float] = {}
    types: dict[str, int] = {}
    others = 0
    repeated: dict[str, None] = {}
    for number, line in enumerate(text.splitlines(), 1):
        words = re.split(r"\s*,\s*|\s+", line.partition("#")[0].strip())
        if words == [""]:
            continue
        try:
            name, value, kind, component = _entry(words)
        except ValueError as error:
            raise ParameterFileError(f"{path}:{number}: {error}") from None
        if component != AUTOPILOT:
            others += 1
            continue
        if values.get(name, value) != value:
            repeated[name] = None
        values[name] = value
        if kind is not None:
            types[name] = kind
    if not values:
        raise ParameterFileError(f"{path}: no parameters; lines are NAME,VALUE or NAME VALUE")
    return ParameterFile(path, values, types, others, tuple(repeated))


def _entry(words: list[str]) -> tuple[str, float, int | None, int]:
    """Name, value, type and component of one line. Raises ValueError with the reason."""
    kind, component = None, AUTOPILOT
    if len(words) == 5 and words[0].isdigit() and words[1].isdigit() and words[4].isdigit():
        component = int(words[1])
        kind = int(words[4]) if int(words[4]) in TYPES else None
        words = words[2:4]
    if words[2:] == ["@READONLY"]:
        words = words[:2]
    if len(words) != 2:
        raise ValueError(
            "not NAME,VALUE, NAME VALUE or five columns of QGroundControl; correct the line or put # before it"
        )
    if not NAME.fullmatch(words[0]):
        raise ValueError(f"{words[0][:40]!r} is not a parameter name: up to 16 capitals, digits and _")
    try:
        value = float(words[1])
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or abs(value) > LARGEST:
        raise ValueError(
            f"{words[0]}: {words[1][:40]!r} is not a number for a parameter; "
            "write one such as 1.5, or put # before the line"
        )
    if words[0] == "MAV_SYSID" and not 1 <= value <= 255:
        raise ValueError(f"{words[0]}: {value:g}: a MAVLink system id is 1 to 255; choose one")
    return words[0], value, kind, component
