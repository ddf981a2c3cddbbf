"""What is fuzzed: every reader of outside bytes, as a function that returns or refuses in one line."""

from __future__ import annotations

import contextlib
import hashlib
import json
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from companion.checkpoint.state_format import SUM_BYTES, StateError, decode_state, encode_state
from companion.core.frames import GeoPoint, LocalFrame, NedPoint
from companion.lidar.models import MODELS, LidarModel
from companion.lidar.reader import Chunk, LidarReader
from companion.lidar.spec import LidarError, parsed
from companion.mapping.map_files import MapError, load_map
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mavlink.codec import Codec
from companion.mavlink.framing import MAGIC_V2
from companion.mavlink.signing import SigningKeyError, load_key
from companion.mavlink.transport import MemoryLink
from companion.mission.load import load_mission
from companion.mission.mission import MissionError
from companion.mission.resolve import resolve
from companion.recording.reader import load_record
from companion.recording.record_format import RecordError, TickEntry, packed_tick
from companion.settings import Settings, SettingsError, load_settings
from companion.settings.tunable_parameters import with_tuned
from companion.vehicle.state import VehicleState, fold
from tests.support.mavlink_vehicle import Station
from tests.support.rig import Rig, yard
from tests.support.states import a_state

MISSIONS = Path(__file__).resolve().parents[2] / "missions"
A_MISSION = b'{"name": "m", "targets": [{"name": "t", "place": [1, 2]}]}'
LONGEST_LINE = 1000
REFUSALS = (MissionError, MapError, SettingsError, RecordError, StateError, SigningKeyError, LidarError)
HEADER_BYTES = 10
ROVER, STATION = 0, 5
"""Senders as ``_packets`` reads them."""
PART_BYTES = 512
DRIVE_S = 90
"""A drive takes less than a second, but many where others want the processor, too."""
LONG_ON_S = 40.0
"""The rover has been switched on for so long, and knows where it is."""
HOME = GeoPoint(53.0, 23.0)


class BadRefusalError(AssertionError):
    """A refusal that is no clear line."""


@contextlib.contextmanager
def refusing() -> Iterator[None]:
    """What is refused is refused in one line; anything else comes through."""
    try:
        yield
    except REFUSALS as error:
        text = str(error)
        if len(text.splitlines()) != 1 or len(text) > LONGEST_LINE or not text.isprintable():
            raise BadRefusalError(text[:3000]) from error


def _file(name: str, data: bytes, use: Callable[[Path], object]) -> None:
    with tempfile.TemporaryDirectory(prefix="fuzz", dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as folder:
        path = Path(folder) / name
        path.write_bytes(data)
        with refusing():
            use(path)


def _mission(path: Path) -> None:
    mission = load_mission(path)
    resolve(mission, LocalFrame(mission.planned_home or HOME), NedPoint(0.0, 0.0))


def mission_toml(data: bytes) -> None:
    """Our own missions."""
    _file("m.toml", data, _mission)


def mission_plan(data: bytes) -> None:
    """QGroundControl's."""
    _file("m.plan", data, _mission)


def mission_wpl(data: bytes) -> None:
    """QGC WPL 110."""
    _file("m.waypoints", data, _mission)


def map_picture(data: bytes) -> None:
    """PNG, PGM or BMP, whatever it is called."""
    _file("m.png", data, load_map)


def map_movingai(data: bytes) -> None:
    """MovingAI."""
    _file("m.map", data, load_map)


def map_yaml(data: bytes) -> None:
    """ROS map_server; the picture it may name is there."""

    def use(path: Path) -> None:
        path.with_name("p.pgm").write_bytes(b"P5\n2 2\n255\n\0\1\2\3")
        load_map(path)

    _file("m.yaml", data, use)


def settings(data: bytes) -> None:
    """The settings file."""
    _file("s.toml", data, load_settings)


def tuned(data: bytes) -> None:
    """What ground stations have set in earlier runs."""
    _file("tuned.toml", data, lambda path: with_tuned(Settings(), path))


def signing_key(data: bytes) -> None:
    """A file with a key."""

    def use(path: Path) -> None:
        path.chmod(0o600)
        load_key(path)

    _file("key", data, use)


def state(data: bytes) -> None:
    """What a run has left; the check sum is put right, or nothing else would ever be looked at."""
    with refusing():
        decode_state(data + hashlib.sha256(data).digest())


def record(data: bytes) -> None:
    """The head of a record."""

    def use(path: Path) -> None:
        for name in ("link.tlog", "decisions.jsonl"):
            (path.parent / name).write_bytes(b"")
        (path.parent / "mission.json").write_bytes(A_MISSION)
        (path.parent / "rounds.bin").write_bytes(packed_tick(TickEntry(0.0, 0, 0)))
        load_record(path.parent)

    _file("meta.json", data, use)


def recorded_mission(data: bytes) -> None:
    """The mission in a record."""
    from companion.mission.serialization import from_json

    with refusing():
        from_json(data, "mission.json")


def link(data: bytes) -> None:
    """Bytes from the line, as they are: first a rover, then anything, with the companion's own answers in between."""
    near, far = MemoryLink.pair()
    options = Settings().link
    autopilot = AutopilotLink(near, Codec(options), options)
    far.write(Station().heartbeat())
    vehicle = VehicleState()
    for number in range(0, len(data) + 64, 64):
        far.write(data[number : number + 64])
        time_s = number / 64.0
        for event in autopilot.poll(time_s):
            vehicle = fold(vehicle, event)
        autopilot.service(time_s)
        vehicle.pose_at(time_s)


def lidar(name: str) -> Callable[[bytes], None]:
    """The reader of a lidar: whatever comes, in pieces, no reading lies outside the limits."""

    def read(data: bytes) -> None:
        spec = parsed(f"{name}:fuzz:min=0.1,max=9")
        port = FuzzedPort()
        reader = LidarReader(spec, port, 1)
        for number, at in enumerate(range(0, len(data), 512)):
            port.chunks.append(Chunk(0.02 * number, data[at : at + 512]))
            for scan in reader.poll(0.02 * number, port):
                hit = scan.range_m[np.isfinite(scan.range_m)]
                assert np.all((hit >= 0.1) & (hit < 9.0))
                assert scan.age_s is not None and np.all(scan.age_s >= 0.0)

    return read


class FuzzedPort:
    """A port that gives what it is given."""

    def __init__(self) -> None:
        self.chunks: list[Chunk] = []

    def read(self) -> list[Chunk]:
        """All at once."""
        chunks, self.chunks = self.chunks, []
        return chunks

    def write(self, data: bytes) -> None:
        """Nobody is there."""

    def close(self) -> None:
        """Nothing to close."""

    def lidar_heard(self, number: int, time_s: float, data: bytes) -> None:
        """Nothing is logged."""


def lidar_spec(data: bytes) -> None:
    """The text of ``--lidar``."""
    with refusing():
        parsed(data.decode(errors="replace"))


def _packets(data: bytes) -> bytes:
    """Packets whose frame is right, of any contents: number of the message, sender, length, then its contents."""
    from pymavlink.dialects.v20 import ardupilotmega as mavlink

    numbers = sorted(mavlink.mavlink_map)
    stream, at = b"", 0
    while at + 4 <= len(data):
        number = numbers[int.from_bytes(data[at : at + 2], "little") % len(numbers)]
        sender, length = data[at + 2], data[at + 3]
        payload = (data[at + 4 : at + 4 + length] or b"\0").rstrip(b"\0") or b"\0"
        system, component = 1 + (sender & 1), (1, 191, 154, 158)[sender >> 1 & 3]
        body = bytes([len(payload), 0, 0, at & 0xFF, system, component]) + number.to_bytes(3, "little") + payload
        crc = mavlink.x25crc(body + bytes([mavlink.mavlink_map[number].crc_extra])).crc
        stream += bytes([MAGIC_V2]) + body + crc.to_bytes(2, "little")
        at += 4 + length
    return stream


def link_contents(data: bytes) -> None:
    """The same with packets whose frame is right."""
    link(_packets(data))


def driving(data: bytes) -> None:
    """Well-formed packets among those of a rover that drives: parameters, requested goals, fences and the like."""
    with tempfile.TemporaryDirectory() as folder:
        rig = Rig(yard(Path(folder)), late_s=LONG_ON_S)
    rig.until_driven(0.2)
    stream = _packets(data)
    parts = [stream[at : at + PART_BYTES] for at in range(0, len(stream), PART_BYTES)]
    rig.garble = lambda heard: heard + (parts.pop(0) if parts else b"")
    rig.run_for((len(parts) + 4) / Settings().link.tick_hz)


def _said(sender: int, name: str, **fields: object) -> bytes:
    """A message as ``_packets`` takes it; to the companion, if it is to anybody."""
    from pymavlink.dialects.v20 import ardupilotmega as mavlink

    kind = next(kind for kind in mavlink.mavlink_map.values() if kind.msgname == name)
    usual = {"target_system": 1, "target_component": 191, "param_id": b""}
    message = kind(**{field: fields.get(field, usual.get(field, 0)) for field in kind.fieldnames})
    payload = message.pack(mavlink.MAVLink(None, 255, 190))[HEADER_BYTES:-2]
    number = sorted(mavlink.mavlink_map).index(kind.id)
    return number.to_bytes(2, "little") + bytes([sender, len(payload)]) + payload


@dataclass(frozen=True, slots=True)
class Target:
    """A reader, and files that it reads well, to begin with. ``most_s``: it hangs if it takes longer for one input."""

    read: Callable[[bytes], None]
    examples: tuple[bytes, ...]
    most_s: int = 10


def targets() -> dict[str, Target]:
    """All of them by name."""
    missions = [path.read_bytes() for path in sorted(MISSIONS.glob("*.toml"))]
    beat = Station()
    talk = beat.heartbeat() + beat.local_position(1000, 1.0) + beat.heartbeat()
    every = "".join(f"[{name}]\n" for name in Settings.model_fields if name != "profile")
    return {
        "mission-toml": Target(mission_toml, tuple(missions)),
        "mission-plan": Target(mission_plan, ((MISSIONS / "field.plan").read_bytes(),)),
        "mission-wpl": Target(mission_wpl, ((MISSIONS / "field.waypoints").read_bytes(),)),
        "map-picture": Target(
            map_picture,
            ((MISSIONS / "maps/rooms.png").read_bytes(), b"P2\n2 2\n255\n0 0 255 254\n", b"P5\n2 2\n255\n\0\1\2\3"),
        ),
        "map-movingai": Target(map_movingai, (b"type octile\nheight 2\nwidth 3\nmap\n.@.\nTS.\n",)),
        "map-yaml": Target(map_yaml, (b"image: p.pgm\nresolution: 0.5\norigin: [1.0, -2.0, 0.0]\nnegate: 0\n",)),
        "settings": Target(
            settings, (b"[guidance]\nhorizon_m = 6.0\n[planner]\n", every.encode(), b'profile = "paper"\n')
        ),
        "tuned": Target(tuned, (b"[guidance]\nhorizon_m = 6.0\n",)),
        "signing-key": Target(signing_key, (b"passphrase\n", b"0f" * 32)),
        "state": Target(state, state_examples()),
        "record": Target(record, record_examples()),
        "recorded-mission": Target(recorded_mission, (A_MISSION,)),
        "link": Target(link, (talk,)),
        **{f"lidar-{one.name.lower()}": Target(lidar(one.name), (lidar_example(one),)) for one in MODELS},
        "lidar-spec": Target(lidar_spec, (b"LD19:/dev/ttyUSB0:yaw=-90,x=0.2,flip,mask=170..190,min=0.3",)),
        "driving": Target(driving, driving_examples(), most_s=DRIVE_S),
        "link-contents": Target(
            link_contents, (b"\0\0\0\x09" + bytes(9), b"\x1e\0\0\x1c" + bytes(28), b"\x5a\0\1\x22" + bytes(34))
        ),
    }


def lidar_example(model: LidarModel) -> bytes:
    """What it sends in a third of a second."""
    from tests.support.lidars import room, started, stream

    return stream(started(room(name=model.name), b"".join(model.start)), 0.35)


def driving_examples() -> tuple[bytes, ...]:
    """Parameters, places to go to, a fence."""
    place = {"frame": 6, "x": 530000000, "y": 230000000}
    return (
        _said(STATION, "PARAM_REQUEST_LIST")
        + _said(STATION, "PARAM_REQUEST_READ", param_id=b"CMP_SPD_MAX", param_index=-1),
        _said(STATION, "PARAM_SET", param_id=b"CMP_SPD_MAX", param_value=0.5, param_type=9),
        _said(STATION, "COMMAND_INT", command=192, **place)
        + _said(STATION, "MISSION_ITEM_INT", command=16, current=2, **place),
        _said(ROVER, "PARAM_VALUE", param_id=b"FENCE_ENABLE", param_value=1.0, param_type=2, param_count=1)
        + _said(ROVER, "FENCE_STATUS", breach_status=1)
        + _said(ROVER, "MISSION_COUNT", count=3, mission_type=1),
    )


def state_examples() -> tuple[bytes, ...]:
    """A state without its check sum."""
    return (encode_state(a_state(), {})[:-SUM_BYTES],)


def record_examples() -> tuple[bytes, ...]:
    """Heads as the recorder writes them, at the end of a run and before."""
    with tempfile.TemporaryDirectory() as folder:
        from companion.recording.recorder import Recorder

        recorder = Recorder(Path(folder) / "r", None, Settings(), 0)
        recorder.close()
        head = json.loads((Path(folder) / "r" / "meta.json").read_text())
    return (
        json.dumps(head).encode(),
        json.dumps(head | {"end": None}).encode(),
        json.dumps(head | {"inputs": [{"kind": "x", "name": "link.tlog", "source": "", "sha256": ""}]}).encode(),
    )
