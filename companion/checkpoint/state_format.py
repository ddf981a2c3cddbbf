"""The state file of a run: its values, and their encoding to bytes and back.

The file: a line with its name and version, the length of the head, the head (JSON), the map in parts, a SHA-256
of everything before. Head and parts are compressed one by one. A file that was cut, or in which one byte differs, is
refused.

Nouns: saved state.
"""

from __future__ import annotations

import hashlib
import json
import struct
import zlib
from collections.abc import Mapping
from dataclasses import astuple, dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from companion.executive.command_progress import CommandResult
from companion.executive.mission_progress import MissionPhase, TargetStatus
from companion.mapping.evidence_map import MAX_EVIDENCE_CELLS
from companion.mapping.lazy_zeros import lazy_zeros
from companion.mission.check import MAX_GRID_FIELDS
from companion.safety.mode_latch import Control
from companion.storage.validation import first_fault
from companion.vehicle.rc_input import PULSES_US

VERSION = 4
MAGIC = b"rover-companion state "
LENGTH = struct.Struct(">I")
SUM_BYTES = hashlib.sha256().digest_size
MAX_FILE_BYTES = 128_000_000
MAX_HEAD_BYTES = 64_000_000
COMPRESSION_LEVEL = 1
"""The fastest. Most of a map is one value, so a higher level saves little."""

Raster = NDArray[np.float32]


class StateError(Exception):
    """A state that cannot be used. The text gives the reason without the file's name."""


class DamagedStateError(StateError):
    """The bytes are not those that were written."""


# The values ----------------------------------------------------------------------------------------------------------

Latitude = Annotated[float, Field(ge=-90.0, le=90.0)]
Longitude = Annotated[float, Field(ge=-180.0, le=180.0)]
Metres = Annotated[float, Field(ge=-1e7, le=1e7)]
MAX_DURATION_S = 1e9
"""Also stands for "forever"."""
Seconds = Annotated[float, Field(ge=0.0, le=MAX_DURATION_S)]
Count = Annotated[int, Field(ge=0, lt=2**63)]
Age = Annotated[float, Field(ge=0.0, le=1.0)]
Figure = Annotated[float, Field(gt=0.0, le=1e3)]
FieldNumber = Annotated[int, Field(ge=-(2**31), lt=2**31)]
GeoPair = tuple[Latitude, Longitude]
Pulse = Annotated[int, Field(ge=PULSES_US.start, lt=PULSES_US.stop)]

NEEDS_TARGET = (MissionPhase.TRAVEL, MissionPhase.STAY, MissionPhase.WAIT)
MAX_TARGETS = 1_000_000
MAX_PAST_FIELDS = 4_000_000
MAX_PART_CELLS = 4_000_000
"""A row of fields of the widest map, or some rows of evidence."""


class SavedValues(BaseModel):
    """Base of all saved values: immutable, without unknown keys, NaN or infinity."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class SavedPlace(SavedValues):
    """A place in the local frame of the saved run, in metres from its origin."""

    name: str = "start"
    north_m: Metres
    east_m: Metres


class SavedRequestedGoal(SavedPlace):
    """A place that a ground station asked the rover to visit during the mission."""

    speed_m_s: Annotated[float, Field(gt=0.0, le=1000.0)] | None


class SavedProgress(SavedValues):
    """Progress through the targets: the result of each, and where to return to. Times are remaining durations."""

    start: SavedPlace
    statuses: tuple[TargetStatus, ...] = Field(min_length=1, max_length=MAX_TARGETS)
    index: Count
    phase: MissionPhase
    left_s: Seconds
    give_up_left_s: Seconds | None
    requested: SavedRequestedGoal | None = None

    @model_validator(mode="after")
    def _agree(self) -> SavedProgress:
        if self.index > len(self.statuses) or (self.phase in NEEDS_TARGET and self.index == len(self.statuses)):
            raise ValueError("there is no such target")
        return self


class SavedOpenCommand(SavedValues):
    """A command of the mission that is open: see ``OpenCommand``. ``place``: -1 where the mission begins."""

    place: Annotated[int, Field(ge=-1, lt=MAX_TARGETS)]
    number: Count
    left_s: Seconds | None
    on_way: bool
    announced: bool
    at: SavedPlace | None = None


class SavedCommandTally(SavedValues):
    """What became of a command so far: see ``CommandTally``."""

    place: Annotated[int, Field(ge=-1, lt=MAX_TARGETS)]
    number: Count
    counts: tuple[tuple[CommandResult, Count], ...] = Field(max_length=len(CommandResult))
    answer: Annotated[int, Field(ge=-1, le=255)] | None


class SavedCommands(SavedValues):
    """How far the commands of the mission are."""

    open: tuple[SavedOpenCommand, ...] = Field((), max_length=MAX_TARGETS)
    tallies: tuple[SavedCommandTally, ...] = Field((), max_length=MAX_TARGETS)


class SavedLap(SavedValues):
    """The present lap of a patrol. ``failed_before``: commands refused or unanswered in the laps before."""

    number: Annotated[int, Field(ge=1, lt=2**63)] = 1
    elapsed_s: Seconds = 0.0
    driven_m: Annotated[float, Field(ge=0.0, le=1e9)] = 0.0
    failed_before: Count = 0
    missed: Count = 0


class SavedNavState(SavedValues):
    """The navigator's state on the way to the present target. Fields count from the grid's south-west corner."""

    past: tuple[tuple[FieldNumber, FieldNumber], ...] = Field(min_length=1, max_length=MAX_PAST_FIELDS)
    returning: bool
    until_search: FieldNumber
    since_better: Count
    draws: Annotated[int, Field(ge=0, lt=2**64)]
    doubts_left: Count


class SavedGrid(SavedValues):
    """Position (metres from the mission's home to the south-west corner) and size of the map."""

    north_m: Metres
    east_m: Metres
    resolution_m: Annotated[float, Field(gt=0.0, le=1e4)]
    width: Annotated[int, Field(ge=1)]
    height: Annotated[int, Field(ge=1)]
    subdivisions: Annotated[int, Field(ge=1)]

    @model_validator(mode="after")
    def _bounded(self) -> SavedGrid:
        fields = self.width * self.height
        if fields > MAX_GRID_FIELDS or fields * self.subdivisions**2 > MAX_EVIDENCE_CELLS:
            raise ValueError("the map is too large")
        return self


class SavedTally(SavedValues):
    """Counts for the summary. ``epoch`` keeps a resumed run from repeating random choices."""

    steps: Count = 0
    return_steps: Count = 0
    stuck: Count = 0
    epoch: Count = 0


class SavedFollowing(SavedValues):
    """How the rover follows velocities: see ``Following``."""

    dead_s: Seconds
    acceleration_m_s2: Figure
    deceleration_m_s2: Figure
    turn_acceleration_rad_s2: Figure
    turn_gain: Figure
    off_model: Annotated[float, Field(ge=0.0, lt=1.0)]
    gains_most_m_s2: Figure
    turn_off_model: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.3


class SavedEstimate(SavedValues):
    """What a run had found about that: see ``ModelEstimate``."""

    began: SavedFollowing
    figures: SavedFollowing
    gathered_s: Seconds
    braked_s: Seconds
    turned_s: Seconds
    steady_s: Seconds = 0.0


class SavedGenerator(SavedValues):
    """State of numpy's PCG64 random generator."""

    state: Annotated[int, Field(ge=0, lt=2**128)]
    inc: Annotated[int, Field(ge=0, lt=2**128)]
    has_uint32: Annotated[int, Field(ge=0, le=1)]
    uinteger: Annotated[int, Field(ge=0, lt=2**32)]


class SavedState(SavedValues):
    """A run at one moment. The names are the keys in the file.

    ``control``, ``armed``: who controlled the rover, and whether its motors were armed. ``released``: the program had
    stopped it and set HOLD. ``boot_s``: the autopilot's time since boot. ``ahead_s``: how far the program's clock was
    ahead of it, constant while both keep running. ``trail``: the way from the start of the mission to here, without
    loops. ``sticks_us``: rest position of the pilot's sticks (steering, throttle), None if they were not seen.
    ``guarded``: a guard on the autopilot was there. ``estimate``: of how the rover follows velocities.
    ``range_ages``: how old the ranges of sensors over MAVLink are, by sender, message and the eighth of the circle.
    ``lap``, ``commands``: of a patrol, and those of the mission for the autopilot.
    """

    mission: str
    mission_sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    ended: bool
    control: Control
    released: bool
    armed: bool
    boot_s: float
    ahead_s: float
    origin: GeoPair
    home: GeoPair
    progress: SavedProgress
    nav_state: SavedNavState | None
    trail: tuple[tuple[FieldNumber, FieldNumber], ...] = Field((), max_length=MAX_PAST_FIELDS)
    ground: SavedGrid
    tally: SavedTally
    draws: SavedGenerator | None
    sticks_us: tuple[Pulse, Pulse] | None = None
    guarded: bool = False
    estimate: SavedEstimate | None = None
    range_ages: tuple[tuple[tuple[Count, str, Count], Age], ...] = ()
    lap: SavedLap = SavedLap()
    commands: SavedCommands = SavedCommands()

    @property
    def reached(self) -> int:
        """Number of targets that were reached."""
        return sum(status is TargetStatus.REACHED for status in self.progress.statuses)


# The bytes -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class MapPart:
    """Which rows and columns of which raster (``log_odds`` or ``penalty``)."""

    raster: str
    first_row: int
    rows: int
    first_column: int
    columns: int


CompressedParts = Mapping[MapPart, bytes]
"""The map. Parts must not overlap."""


def compressed_part(part: Raster) -> bytes:
    """A part of a raster as compressed little-endian floats."""
    return zlib.compress(np.ascontiguousarray(part, "<f4").tobytes(), COMPRESSION_LEVEL)


def encode_state(state: SavedState, parts: CompressedParts) -> bytes:
    """The bytes of the state file."""
    table = [(*astuple(part), len(data)) for part, data in parts.items()]
    head_json = json.dumps({"state": state.model_dump(mode="json"), "parts": table})
    head = zlib.compress(head_json.encode(), COMPRESSION_LEVEL)
    body = b"".join((MAGIC, b"%d\n" % VERSION, LENGTH.pack(len(head)), head, *parts.values()))
    return body + hashlib.sha256(body).digest()


def decode_state(data: bytes) -> tuple[SavedState, dict[str, Raster]]:
    """State and rasters (``log_odds``, ``penalty``; zero where there is no part).

    Raises DamagedStateError, or StateError for another version of the format.
    """
    body, checksum = data[:-SUM_BYTES], data[-SUM_BYTES:]
    if len(data) < SUM_BYTES or hashlib.sha256(body).digest() != checksum:
        raise DamagedStateError("damaged (wrong checksum)")
    line, separator, rest = body.partition(b"\n")
    if not line.startswith(MAGIC) or not separator:
        raise DamagedStateError("not a state file of rover-companion")
    version = line[len(MAGIC) :]
    if version != b"%d" % VERSION:
        raise StateError(f"written in format {version[:20].decode('ascii', 'replace')!r}, this program reads {VERSION}")
    try:
        return _decode_body(rest)
    except (ValueError, KeyError, TypeError, RecursionError, struct.error, zlib.error) as error:
        raise DamagedStateError(f"damaged ({_reason(error)})") from error


def _decode_body(rest: bytes) -> tuple[SavedState, dict[str, Raster]]:
    length = LENGTH.unpack_from(rest)[0]
    start = LENGTH.size + length
    head = json.loads(_decompressed(rest[LENGTH.size : start], MAX_HEAD_BYTES))
    if not isinstance(head, dict) or set(head) != {"state", "parts"} or not isinstance(head["parts"], list):
        raise ValueError("unexpected content of the head")
    state = SavedState.model_validate(head["state"])
    ground = state.ground
    fine = (ground.height * ground.subdivisions, ground.width * ground.subdivisions)
    rasters = {"log_odds": lazy_zeros(fine, np.float32), "penalty": np.zeros((ground.height, ground.width), np.float32)}
    for raster, *place, size in head["parts"]:
        _fill(rasters[raster], MapPart(raster, *place), rest[start : start + size])
        start += size
    if start != len(rest):
        raise ValueError("bytes left over")
    return state, rasters


def _fill(raster: Raster, part: MapPart, data: bytes) -> None:
    height, width = raster.shape
    if not (_within(part.first_row, part.rows, height) and _within(part.first_column, part.columns, width)):
        raise ValueError("a part lies outside the map")
    if part.rows * part.columns > MAX_PART_CELLS:
        raise ValueError("a part of the map is too large")
    values = np.frombuffer(_decompressed(data, part.rows * part.columns * 4), "<f4")
    if not np.isfinite(values).all():
        raise ValueError("the map contains NaN or infinity")
    if values.any():  # zeros take no memory
        y, x = part.first_row, part.first_column
        raster[y : y + part.rows, x : x + part.columns] = values.reshape(part.rows, part.columns)


def _within(first: int, count: int, size: int) -> bool:
    return type(first) is type(count) is int and 0 <= first < size and 0 < count <= size - first


def _decompressed(data: bytes, max_bytes: int) -> bytes:
    """Raises ValueError if the data was cut or would become larger than ``max_bytes``."""
    decompressor = zlib.decompressobj()
    result = decompressor.decompress(
        data, max_bytes + 1
    )  # with exactly max_bytes the end of the data would not be read
    if not decompressor.eof or decompressor.unused_data or len(result) > max_bytes:
        raise ValueError("a part is cut or too large")
    return result


def _reason(error: Exception) -> str:
    if isinstance(error, ValidationError):
        place, reason = first_fault(error)
        return f"{place}: {reason}"
    return str(error).splitlines()[0][:100] if str(error) else type(error).__name__
