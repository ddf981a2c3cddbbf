"""A lidar as it is given on the command line: ``MODEL:PORT[:KEY=VALUE,...]``.

Nouns: lidar spec.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from companion.lidar.models import NAMES, LidarModel, model_named
from companion.storage.validation import alike

FORM = "MODEL:PORT[:yaw=DEG,x=M,y=M,flip,mask=FROM..TO,min=M,max=M,intensity=N,empty=M]"
OPTIONS = ("yaw", "x", "y", "flip", "mask", "min", "max", "intensity", "empty")
EMPTY_M = 5.0
"""Beyond this a dark surface may well give no echo though nothing is wrong."""
LONGEST = 500
FARTHEST_M = 10.0
"""No lidar is mounted farther from the middle of a rover."""


class LidarError(Exception):
    """A lidar that cannot be used; the text is one line with the place, the reason and the remedy."""


@dataclass(frozen=True, slots=True)
class Mounting:
    """How a lidar sits on the rover, and which readings count.

    ``yaw_deg``: where its zero looks, clockwise from straight ahead; ``forward_m``, ``right_m``: its place from the
    rover's middle; ``flipped``: upside down. ``masked_deg``: sectors (from, to), clockwise from straight ahead as seen
    from the lidar, in [0, 360). Nearer readings than ``min_m`` say nothing; farther ones than ``max_m``, and no echo at
    all, mean that nothing is there up to ``empty_m``; 0: they say nothing. ``empty_told``: a person said so, and it
    holds also where there is no echo in a whole turn. Echoes weaker than ``least_quality`` say nothing.
    """

    min_m: float
    max_m: float
    yaw_deg: float = 0.0
    forward_m: float = 0.0
    right_m: float = 0.0
    flipped: bool = False
    masked_deg: tuple[tuple[float, float], ...] = ()
    least_quality: int = 0
    empty_m: float = EMPTY_M
    empty_told: bool = False


@dataclass(frozen=True, slots=True)
class LidarSpec:
    """``text``: as it was given."""

    model: LidarModel
    port: str
    mounting: Mounting
    text: str = field(compare=False)


def parsed(text: str, port: str = "") -> LidarSpec:
    """The lidar that a text describes. ``port``: where it is, if the text has none. Raises LidarError."""
    if not text.isprintable() or len(text) > LONGEST:
        raise LidarError(f"lidar {text!a:.60}: has characters that no option has, or too many; write {FORM}")
    name, _, rest = text.partition(":")
    model = model_named(name)
    if model is None:
        raise LidarError(f"lidar '{text}': {name!r:.40} is no model; models are {NAMES}")
    whole = text
    if port:
        whole, options = f"{name}:{port}{':' * bool(rest)}{rest}", rest
    else:
        port, options = _split(rest)
    if not port:
        raise LidarError(f"lidar '{text}': names no port; write {FORM}")
    if "=" in port:
        raise LidarError(f"lidar '{text}': one colon stands before all options, and commas between them: {FORM}")
    mounting, given = Mounting(model.min_m, model.max_m), set[str]()
    for option in filter(None, map(str.strip, options.split(","))):
        mounting, key = _with_option(mounting, option, model, text), option.partition("=")[0]
        if key in given and key != "mask":
            raise LidarError(f"lidar '{text}': {key} is given twice; once is enough")
        given.add(key)
    if mounting.min_m >= mounting.max_m:
        limits = f"min={mounting.min_m:g} is not below max={mounting.max_m:g}"
        raise LidarError(f"lidar '{text}': {limits}; the {model.name} sees from {model.min_m:g} to {model.max_m:g} m")
    return LidarSpec(model, port, mounting, whole)


def _split(rest: str) -> tuple[str, str]:
    """Port and options. Ports below /dev/serial/by-path have colons of their own; they end with numbers."""
    port, colon, options = rest.rpartition(":")
    is_words = not any(one.isdigit() for one in options)  # also of an option that is none, which is refused then
    if colon and (is_words or "=" in options or " " in options or options.startswith("flip,")):
        return port, options
    return rest, ""


def _with_option(mounting: Mounting, option: str, model: LidarModel, text: str) -> Mounting:
    key, _, value = option.partition("=")
    match key:
        case "flip" if value in ("", "yes", "no"):
            return replace(mounting, flipped=value != "no")
        case "empty":
            return replace(mounting, empty_m=_number(text, option, 0.0, model.max_m), empty_told=True)
        case "yaw":
            return replace(mounting, yaw_deg=_number(text, option, -360.0, 360.0))
        case "x":
            return replace(mounting, forward_m=_number(text, option, -FARTHEST_M, FARTHEST_M))
        case "y":
            return replace(mounting, right_m=_number(text, option, -FARTHEST_M, FARTHEST_M))
        case "min":
            return replace(mounting, min_m=_number(text, option, 0.0, model.max_m))
        case "max":
            return replace(mounting, max_m=_number(text, option, 0.1, model.max_m))
        case "mask":
            return replace(mounting, masked_deg=(*mounting.masked_deg, _mask(text, option)))
        case "intensity":
            if not model.most_quality:
                raise LidarError(f"lidar '{text}': {option}: the {model.name} does not tell how strong echoes are")
            return replace(mounting, least_quality=int(_number(text, option, 0.0, float(model.most_quality))))
        case _:
            meant = alike(key, OPTIONS)
            if meant:
                raise LidarError(f"lidar '{text}': '{option}' is no option, did you mean {meant}?")
            hint = "; decimals have a point, 1.8 and not 1,8" if option.isdecimal() else f"; write {FORM}"
            raise LidarError(f"lidar '{text}': '{option}' is no option{hint}")


def _number(text: str, option: str, least: float, most: float) -> float:
    key, _, value = option.partition("=")
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not least <= number <= most:
        raise LidarError(f"lidar '{text}': {key}={value}: give a number from {least:g} to {most:g}")
    return number


def _mask(text: str, option: str) -> tuple[float, float]:
    first, dots, last = option.removeprefix("mask=").partition("..")
    if not dots:
        raise LidarError(f"lidar '{text}': {option}: write mask=FROM..TO in degrees clockwise from ahead")
    begin_deg = _number(text, f"mask={first}", -360.0, 360.0)
    end_deg = _number(text, f"mask={last}", -360.0, 360.0)
    if (end_deg - begin_deg) % 360.0 == 0.0:
        raise LidarError(f"lidar '{text}': {option}: a mask that begins where it ends hides nothing or all")
    return begin_deg % 360.0, end_deg % 360.0
