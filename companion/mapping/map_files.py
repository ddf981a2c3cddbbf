"""Map files: ROS map_server (yaml with pgm, png or bmp), MovingAI ``.map`` and plain images, to and from ``Grid``.

In every picture the top row is the north edge and the left column the west edge, and dark is an obstacle (as ROS
draws maps; the figures of Kwasniewski & Gosiewski 2018 have it the other way round). A ``Grid`` knows
obstacles and costs only: free and unknown ground both get the base weight.
"""

from __future__ import annotations

import math
import reprlib
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from companion.core.frames import NedPoint, wrap_pi_rad
from companion.core.grid import BASE_WEIGHT, OBSTACLE, Grid, Weights
from companion.mapping.turned_map import turned, turned_size
from companion.storage.files import open_file, read_bytes, why_no_file, write_whole

MAX_FIELDS = 25_000_000
"""Larger maps are refused before memory is asked for (5000 x 5000 fields are 200 MB of weights)."""

LARGEST = 1e9
"""No number in a map file has a reason to be larger."""

NOT_TURNED_RAD = 1e-6
QUARTER_RAD, ROUNDED_RAD = 0.5 * math.pi, 1e-3
"""A yaw as near to a quarter turn as this was rounded: with 1.5708 every field would overlap two others."""
MAX_TEXT_BYTES = 2 * MAX_FIELDS
MAX_YAML_BYTES = 100_000
IMAGE_SUFFIXES = (".png", ".pgm", ".bmp")
FREE_GREY, UNKNOWN_GREY, OBSTACLE_GREY = 254, 205, 0


class MapError(Exception):
    """A map file that cannot be used; the text is one line with file, place and reason."""


@dataclass(frozen=True, slots=True)
class Shades:
    """How grey becomes occupancy (ROS map_server): 1 is surely occupied, and where the lines are drawn."""

    occupied_thresh: float = 0.65
    free_thresh: float = 0.196
    negate: bool = False
    mode: Literal["trinary", "scale", "raw"] = "trinary"


WEIGHED = Shades(occupied_thresh=0.99, free_thresh=0.0, mode="scale")
"""Of maps whose greys are weights."""
MOST_SHARE = 0.99
"""Of the way from free ground to an obstacle: what is more is an obstacle."""


def load_map(path: Path, resolution_m: float | None = None) -> Grid:
    """Read a map; the suffix tells the format.

    ``resolution_m`` is the field size of maps that have none of their own (images, MovingAI), 1 m if not given; a ROS
    yaml's own resolution always counts. ``Grid.south_west`` is the yaml's origin (x east, y north), else (0, 0); a map
    that is turned there (yaw) is laid on a grid that looks north (``turned``).
    Raises MapError.
    """
    suffix = path.suffix.lower()
    if resolution_m is not None and not (math.isfinite(resolution_m) and resolution_m > 0.0):
        raise MapError(f"{path}: resolution: {resolution_m} m is not a field size")
    size_m = 1.0 if resolution_m is None else resolution_m
    if suffix in (".yaml", ".yml"):
        return _load_ros(path)
    if suffix == ".map":
        return Grid(_read_movingai(path), size_m)
    if suffix in IMAGE_SUFFIXES:
        return Grid(_weights_of(*_read_grey(path), Shades()), size_m)
    if path.is_dir():
        raise MapError(f"{path}: is a folder, not a map; name a file in it")
    raise MapError(f"{path}: suffix '{path.suffix}' is no map format; known: .yaml, .map, {', '.join(IMAGE_SUFFIXES)}")


def save_ros_map(grid: Grid, path_without_suffix: Path, known: NDArray[np.bool_] | None = None) -> None:
    """Write ``<path>.yaml`` and ``<path>.pgm`` (P5) for map_server; loading it gives the same obstacles in place.

    ``known``: shape (height, width), which fields have been seen; others that are no obstacles are written as unknown.
    Without it every field that is no obstacle is written as free. Raises MapError when the files cannot be written.
    """
    grey = np.full(grid.weights.shape, FREE_GREY, dtype=np.uint8)
    if known is not None:
        grey[~known] = UNKNOWN_GREY
    grey[grid.weights >= OBSTACLE] = OBSTACLE_GREY
    _save_ros(grid, path_without_suffix, grey, Shades())


def save_weighed_map(grid: Grid, path_without_suffix: Path) -> None:
    """Like ``save_ros_map``, with the weights as well, in 65536 shades; no weight is less than the base weight.

    Raises MapError when the files cannot be written.
    """
    share = np.clip((grid.weights - BASE_WEIGHT) / (OBSTACLE - BASE_WEIGHT), 0.0, MOST_SHARE)
    occupancy = np.where(grid.weights >= OBSTACLE, 1.0, WEIGHED.occupied_thresh * share)
    _save_ros(grid, path_without_suffix, np.rint(65535.0 * (1.0 - occupancy)).astype(">u2"), WEIGHED)


def _save_ros(grid: Grid, path_without_suffix: Path, grey: NDArray[np.unsignedinteger], shades: Shades) -> None:
    """``grey``: south row first. Raises MapError."""
    image = path_without_suffix.with_name(path_without_suffix.name + ".pgm")
    text = yaml.safe_dump(
        {
            "image": image.name,
            "mode": shades.mode,
            "resolution": float(grid.resolution_m),
            "origin": [float(grid.south_west.east_m), float(grid.south_west.north_m), 0.0],
            "negate": 0,
            "occupied_thresh": shades.occupied_thresh,
            "free_thresh": shades.free_thresh,
        },
        sort_keys=False,
        allow_unicode=True,
    )
    try:
        write_whole(
            image, f"P5\n{grid.width} {grid.height}\n{np.iinfo(grey.dtype).max}\n".encode() + grey[::-1].tobytes()
        )
        write_whole(image.with_suffix(".yaml"), text.encode())
    except OSError as error:
        raise MapError(f"{image}: cannot be written: {error.strerror}; choose another place") from error


def _check_size(path: Path, width: int, height: int) -> None:
    if width < 1 or height < 1:
        raise MapError(f"{path}: size: {width} x {height} has no fields")
    if width * height > MAX_FIELDS:
        raise MapError(f"{path}: size: {width} x {height} is more than {MAX_FIELDS} fields")


def _read_grey(path: Path) -> tuple[NDArray[np.float32], NDArray[np.bool_] | None]:
    """Shade 0 (black) to 1 (white) per pixel, top row first, and which pixels are transparent (None: none).

    Colours are averaged with equal shares, as map_server does, not by how bright they look.
    """
    try:
        file = open_file(path)
    except FileNotFoundError:
        raise MapError(f"{path}: no such file; check the path") from None
    except OSError as error:
        raise MapError(f"{path}: cannot be read: {error.strerror}; name a PNG, PGM or BMP picture") from error
    try:
        with file, warnings.catch_warnings():
            # Pillow warns of large pictures; the limit here is lower than that of its error.
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(file, formats=("PNG", "PPM", "BMP")) as image:
                _check_size(path, image.width, image.height)
                if image.mode in ("I", "I;16", "I;16B"):
                    return np.asarray(image, dtype=np.float32) / np.float32(65535.0), None
                if image.mode in ("1", "L"):
                    return np.asarray(image.convert("L"), dtype=np.float32) / np.float32(255.0), None
                pixels = np.asarray(image.convert("RGBA"))
    except Image.DecompressionBombError:
        raise MapError(f"{path}: size: more than {MAX_FIELDS} fields") from None
    except UnidentifiedImageError:
        raise MapError(f"{path}: header: not a PNG, PGM or BMP picture") from None
    except (OSError, ValueError, SyntaxError, EOFError, OverflowError) as error:
        raise MapError(f"{path}: picture: {_one_line(error)}") from error
    shade = pixels[:, :, :3].sum(axis=2, dtype=np.uint16).astype(np.float32) / np.float32(765.0)
    return shade, pixels[:, :, 3] < 128


def _weights_of(shade: NDArray[np.float32], transparent: NDArray[np.bool_] | None, shades: Shades) -> Weights:
    """Weights, south row first. What is neither free nor occupied is unknown ground and gets the base weight."""
    if shades.mode == "raw":
        # Raw pictures hold occupancy in per cent as it is; above 100 is unknown, negate does not count.
        percent = np.rint(shade * 255.0)
        occupancy = np.where(percent <= 100.0, percent / 100.0, 0.0)
        occupied, between = occupancy >= 1.0, occupancy
    else:
        occupancy = shade if shades.negate else 1.0 - shade
        occupied = occupancy > shades.occupied_thresh
        span = max(shades.occupied_thresh - shades.free_thresh, 1e-9)
        between = np.clip((occupancy - shades.free_thresh) / span, 0.0, MOST_SHARE)
    weights = np.full(shade.shape, BASE_WEIGHT)
    if shades.mode != "trinary":
        weights += (OBSTACLE - BASE_WEIGHT) * np.minimum(between, MOST_SHARE)
    weights[occupied] = OBSTACLE
    if transparent is not None:
        weights[transparent] = BASE_WEIGHT
    return np.ascontiguousarray(weights[::-1])


def _load_ros(path: Path) -> Grid:
    fields = _read_yaml(path)
    image = fields.get("image")
    if not isinstance(image, str) or not image or "\0" in image:
        raise MapError(f"{path}: image: the picture's file name is missing")
    resolution_m = _number(path, "resolution", fields.get("resolution"))
    if resolution_m <= 0.0:
        raise MapError(f"{path}: resolution: {resolution_m} m is not a field size")
    origin = fields.get("origin")
    if not isinstance(origin, list) or len(origin) != 3:
        raise MapError(f"{path}: origin: expected [x, y, yaw], got {reprlib.repr(origin)}")
    east_m, north_m, yaw_rad = (_number(path, "origin", value) for value in origin)
    shades = _shades(path, fields)
    picture = path.parent / image
    if fault := why_no_file(picture):
        raise MapError(f"{path}: image: {picture}: {fault}")
    weights, corner = _weights_of(*_read_grey(picture), shades), NedPoint(north_m, east_m)
    quarters_rad = round(yaw_rad / QUARTER_RAD) * QUARTER_RAD
    yaw_rad = quarters_rad if abs(yaw_rad - quarters_rad) <= ROUNDED_RAD else yaw_rad
    if abs(wrap_pi_rad(yaw_rad)) <= NOT_TURNED_RAD:
        return Grid(weights, resolution_m, corner)
    width, height = turned_size(weights.shape[1], weights.shape[0], yaw_rad)
    if width * height > MAX_FIELDS:
        raise MapError(f"{path}: origin: turned by {yaw_rad:g} rad it needs more than {MAX_FIELDS} fields")
    return turned(weights, resolution_m, corner, yaw_rad)


def _read_yaml(path: Path) -> dict[object, object]:
    data = read_bytes(path, MapError, MAX_YAML_BYTES)
    try:
        fields = yaml.safe_load(data)
    except yaml.MarkedYAMLError as error:
        line = f"line {error.problem_mark.line + 1}" if error.problem_mark else "yaml"
        raise MapError(f"{path}: {line}: {_one_line(error.problem or error.context or 'not yaml')}") from error
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError, ValueError) as error:
        raise MapError(f"{path}: not yaml: {_one_line(error)}") from error
    if not isinstance(fields, dict):
        raise MapError(f"{path}: not a map_server file: expected keys such as image, resolution, origin")
    return fields


def _shades(path: Path, fields: dict[object, object]) -> Shades:
    occupied = _number(path, "occupied_thresh", fields.get("occupied_thresh", 0.65))
    free = _number(path, "free_thresh", fields.get("free_thresh", 0.196))
    if not 0.0 <= free <= occupied <= 1.0:
        raise MapError(f"{path}: thresholds: expected 0 <= free_thresh <= occupied_thresh <= 1, got {free}, {occupied}")
    negate = fields.get("negate", 0)
    if negate not in (0, 1):
        raise MapError(f"{path}: negate: expected 0 or 1, got {reprlib.repr(negate)}")
    mode = fields.get("mode", "trinary")
    if mode not in ("trinary", "scale", "raw"):
        raise MapError(f"{path}: mode: expected trinary, scale or raw, got {reprlib.repr(mode)}")
    return Shades(occupied, free, bool(negate), mode)


def _number(path: Path, place: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < LARGEST:
        raise MapError(f"{path}: {place}: expected a number, got {reprlib.repr(value)}")
    return float(value)


PASSABLE, BLOCKED = ".GS", "@OTW"
"""MovingAI terrain. Swamp (S) costs the same as ground there; water (W) is no ground for a rover."""


def _read_movingai(path: Path) -> Weights:
    lines = read_bytes(path, MapError, MAX_TEXT_BYTES).decode("latin-1").splitlines()
    head = [line.split() for line in lines[:4]]
    if len(head) < 4 or head[0][:1] != ["type"] or head[3] != ["map"]:
        raise MapError(f"{path}: header: expected the lines type, height, width, map")
    sizes: dict[str, int] = {}
    for number, words in enumerate(head[1:3], start=2):
        if len(words) != 2 or words[0] not in ("height", "width") or not words[1].isascii() or not words[1].isdigit():
            raise MapError(f"{path}: line {number}: expected height or width and a whole number")
        if len(words[1]) > 9:
            raise MapError(f"{path}: line {number}: more than {MAX_FIELDS} fields")
        sizes[words[0]] = int(words[1])
    if len(sizes) != 2:
        raise MapError(f"{path}: header: height and width are both needed")
    height, width = sizes["height"], sizes["width"]
    _check_size(path, width, height)
    rows = lines[4 : 4 + height]
    if len(rows) < height:
        raise MapError(f"{path}: line {5 + len(rows)}: the map ends after {len(rows)} of {height} rows")
    weights = np.full((height, width), BASE_WEIGHT)
    for y, row in enumerate(rows):
        if len(row) != width:
            raise MapError(f"{path}: line {y + 5}: {len(row)} fields instead of {width}")
        strange = set(row) - set(PASSABLE + BLOCKED)
        if strange:
            raise MapError(f"{path}: line {y + 5}: unknown terrain {min(strange)!r}")
        codes = np.frombuffer(row.encode("ascii"), dtype=np.uint8)
        weights[height - 1 - y, np.isin(codes, np.frombuffer(BLOCKED.encode(), dtype=np.uint8))] = OBSTACLE
    return weights


def _one_line(what: object) -> str:
    return " ".join(str(what).split())[:200] or type(what).__name__
