"""The lidars that can be read: their serial lines, commands, ranges and decoders (docs/lidars.md).

Seen from above, all of them turn clockwise, and so do their angles; zero is where the manual draws the front.

Nouns: lidar model.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from companion.lidar.ldrobot import LdrobotDecoder
from companion.lidar.points import Decoder
from companion.lidar.rplidar import RplidarDecoder
from companion.lidar.ydlidar import YdlidarDecoder


@dataclass(frozen=True, slots=True)
class LidarModel:
    """One model. ``start`` and ``stop``: commands; empty where it turns whenever it has power.

    ``turns_hz``: the usual rate; ``dtr``: the state of this line of the serial port while it turns (the RPLIDAR A1's
    adapter switches the motor off when the line is set, as every program sets it that opens a port).
    ``most_quality``: the strongest echo; 0: it tells none.
    """

    name: str
    baud: int
    decoder: Callable[[], Decoder]
    min_m: float
    max_m: float
    turns_hz: float
    most_quality: int
    start: tuple[bytes, ...] = ()
    stop: tuple[bytes, ...] = ()
    dtr: bool = True


RP_STOP, RP_SCAN = b"\xa5\x25", b"\xa5\x20"
YD_STOP, YD_SCAN = b"\xa5\x65", b"\xa5\x60"
MODELS = (
    LidarModel("LD06", 230400, LdrobotDecoder, 0.02, 12.0, 10.0, 255),
    LidarModel("LD19", 230400, LdrobotDecoder, 0.02, 12.0, 10.0, 255),
    LidarModel("RPLIDAR-A1", 115200, RplidarDecoder, 0.15, 12.0, 5.5, 63, (RP_STOP, RP_SCAN), (RP_STOP,), dtr=False),
    LidarModel("RPLIDAR-C1", 460800, RplidarDecoder, 0.05, 12.0, 10.0, 63, (RP_STOP, RP_SCAN), (RP_STOP,), dtr=False),
    LidarModel("YDLIDAR-X4", 128000, YdlidarDecoder, 0.12, 10.0, 7.0, 0, (YD_STOP, YD_SCAN), (YD_STOP,)),
)
NAMES = ", ".join(one.name if "-" not in one.name else f"{one.name} ({one.name[-2:]})" for one in MODELS)
UNSPOKEN = str.maketrans("", "", "-_ ")
"""Left out where names are compared: people write LD-06, too."""


def model_named(name: str) -> LidarModel | None:
    """The model with this name, however it is spelt; None if there is none."""
    wanted = name.upper().translate(UNSPOKEN)
    return next((one for one in MODELS if wanted in (one.name.translate(UNSPOKEN), one.name.rpartition("-")[2])), None)
