"""Parameter files as ground stations write them: Mission Planner (NAME,VALUE), MAVProxy (NAME VALUE), QGroundControl (five columns).

Pure reading: which of the names are simulated is not known here.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from companion.storage.reading import open_file
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
"""Component that a rover's parameters belong to; QGroundControl's files may hold those of others as well."""
TYPES = (INT8, INT16, INT32, REAL32)
MOST_BYTES = 1_000_000
NAMES_TOLD = 5
LARGEST = 3.4e38
"""Of a 32-bit float."""
COUNTS = frozenset({"FENCE_TOTAL", "MIS_TOTAL", "RALLY_TOTAL"})
"""The autopilot sets these itself; what a file says of them is passed over."""


class ParameterFileError(Exception):
    """A parameter file that cannot be used; the text is one line with file, line, reason and remedy."""


@dataclass(frozen=True, slots=True)
class ParameterFile:
    """What a file says: values by name, the last of several counts; MAV_PARAM_TYPE of those that say one. ``others``: lines of other components."""

    path: Path
    values: dict[str, float]
    types: dict[str, int]
    others: int = 0
    repeated: tuple[str, ...] = ()
    """Names that stand there more than once with different values."""

    @property
    def known(self) -> dict[str, float]:
        """Those that the simulator has."""
        return {name: value for name, value in self.values.items() if name in DEFAULTS.keys() - COUNTS}

    @property
    def unknown(self) -> dict[str, float]:
        """Those that it only keeps."""
        return {name: value for name, value in self.values.items() if name not in DEFAULTS}

    @property
    def is_skid(self) -> bool:
        """Whether it says that the rover has skid steering."""
        return is_skid(self.values)

    @property
    def is_steered(self) -> bool:
        """Whether it says that the rover has steered wheels and one throttle."""
        return not self.is_skid and {GROUND_STEERING, THROTTLE} <= functions_of(self.values)

    def notes(self, steered: bool) -> tuple[str, ...]:
        """What a person should know before this file drives the plant, which has steered wheels or not; a line each."""
        wired = {1: GROUND_STEERING, 3: THROTTLE} if steered else {1: THROTTLE_LEFT, 3: THROTTLE_RIGHT}
        odd = [
            f"SERVO{n}_FUNCTION {self.values[f'SERVO{n}_FUNCTION']:g}"
            for n, function in wired.items()
            if self.values.get(f"SERVO{n}_FUNCTION", function) != function
        ]
        odd += [f"SERVO{n}_REVERSED 1" for n in wired if self.values.get(f"SERVO{n}_REVERSED", 0.0)]
        motors = f"{wired[1]} on output 1 and {wired[3]} on output 3"
        wrong = f"{self.path}: {', '.join(odd)}: the simulated motors are wired as {motors}, not reversed; it will drive wrongly"
        return (*(text for text in (self.note(),) if text), *self.slips, *((wrong,) if odd else ()))

    def firmware_notes(self, told: Mapping[str, float] | None) -> tuple[str, ...]:
        """What a person should know before this file drives the real firmware, a line each.

        ``told``: everything that is written for the firmware; None if nothing is.
        """
        if told is None:
            only = "says here only what kind of steering the rover has; --write-params FILE writes the rest for the firmware"
            return (f"{self.path}: {only}", *self.slips)
        changed = tuple(
            f"{self.path}: {name} {value:g} becomes {told[name]:g}, as our rover is built"
            for name, value in self.values.items()
            if told.get(name, value) != value
        )
        unknown = list(self.unknown)
        passed = f"{self.path}: {len(unknown)} parameters that are not known here are passed on as they are: {_some(unknown)}"
        return (*self.slips, *changed, *((passed,) if unknown else ()))

    @property
    def slips(self) -> tuple[str, ...]:
        """What is most likely not meant, whoever drives; a line each."""
        limits = outside(self.values)
        twice = f"{self.path}: {_some(self.repeated)}: there more than once; the last value counts"
        odd = f"{self.path}: outside of the range that ArduRover documents: {_some(limits)}; see if they are meant"
        return (*((twice,) if self.repeated else ()), *((odd,) if limits else ()))

    def note(self) -> str:
        """One line about what is kept but has no effect; empty when there is nothing of it."""
        names = list(self.unknown)
        if not names:
            return ""
        count = f"{len(names)} of {len(self.values)} parameters are not simulated and only kept to be read back"
        return f"{self.path}: {count}: {_some(names)}"


def _some(names: Sequence[str]) -> str:
    """The first few of a list."""
    return ", ".join(names[:NAMES_TOLD]) + (", ..." if len(names) > NAMES_TOLD else "")


def load_parameters(path: Path) -> ParameterFile:
    """Read a parameter file. Raises ParameterFileError."""
    try:
        with open_file(path) as file:
            data = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise ParameterFileError(f"{path}: cannot be read: {error.strerror or error}; check the name") from error
    if len(data) > MOST_BYTES:
        raise ParameterFileError(
            f"{path}: more than {MOST_BYTES} bytes are too many for a parameter file; is it another file?"
        )
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ParameterFileError(f"{path}: is no text (byte {error.start}); is it another file?") from error
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
        raise ParameterFileError(f"{path}: no parameters in it; lines are NAME,VALUE or NAME VALUE")
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
            "not NAME,VALUE nor NAME VALUE nor a line of QGroundControl's five columns; correct it or put # before it"
        )
    if not NAME.fullmatch(words[0]):
        raise ValueError(f"{words[0][:40]!r} is no parameter's name: up to 16 capitals, digits and _")
    try:
        value = float(words[1])
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or abs(value) > LARGEST:
        raise ValueError(
            f"{words[0]}: {words[1][:40]!r} is no number that a parameter can hold; write one such as 1.5, or put # before the line"
        )
    if words[0] == "MAV_SYSID" and not 1 <= value <= 255:
        raise ValueError(f"{words[0]}: {value:g}: a MAVLink system has a number from 1 to 255; choose one")
    return words[0], value, kind, component
