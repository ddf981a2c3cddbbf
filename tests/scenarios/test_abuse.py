"""Hostile sizes, floods, borrowed ids: refused or limited in one clear line; and no file is written elsewhere."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
import tracemalloc
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.executive.mission_executor import MissionExecutor
from companion.vehicle.state import PARAMETERS_KEPT
from tests.support.forked import Forked
from tests.support.quick import first_of
from tests.support.rig import Rig, yard
from tests.support.served import finished, mission_path, served

MEMORY_BYTES = 600_000_000
"""What a program may take beyond its libraries, which reserve much more than they use."""
ITEM = "0\t0\t3\t16\t0\t0\t0\t0\t53.1\t23.1\t0\t1\n"


def png_of(width: int, height: int) -> bytes:
    """A picture of that size that is one white point and then ends."""
    head = b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    body = b"IDAT" + zlib.compress(b"\0\xff")
    chunks = [struct.pack(">I", len(part) - 4) + part + struct.pack(">I", zlib.crc32(part)) for part in (head, body)]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


def mission_with(line: str) -> bytes:
    return f"{line}\n[[target]]\nnorth_m = 5.0\neast_m = 0.0\n".encode()


ROS = b"image: big.png\nresolution: 0.05\norigin: [0.0, 0.0, 0.0]\n"
HOSTILE: dict[str, tuple[str, Callable[[], bytes], str]] = {
    "400 000 items, WPL": (
        "m.waypoints",
        lambda: b"QGC WPL 110\n" + b"".join(b"%d" % i + ITEM[1:].encode() for i in range(400_000)),
        "more than",
    ),
    "a million items, too long to be read": (
        "m.waypoints",
        lambda: b"QGC WPL 110\n" + ITEM.encode() * 1_000_000,
        "larger than",
    ),
    "a million targets": ("m.toml", lambda: b"[[target]]\nnorth_m = 5.0\neast_m = 1.0\n" * 1_000_000, "larger than"),
    "a grid of 10^9 fields": (
        "m.toml",
        lambda: mission_with("[grid]\nsize = [31623, 31623]\nhome = [5, 5]"),
        "more than",
    ),
    "places 10^9 fields apart": (
        "m.toml",
        lambda: mission_with("[[keep_out]]\nnorth_m = 900000.0\neast_m = 900000.0\nradius_m = 5.0"),
        "is more ground than",
    ),
    "a number of 5000 digits": ("m.toml", lambda: mission_with(f"name = {'9' * 5000}"), "not valid TOML"),
    "nested without end": ("m.toml", lambda: b"a = " + b"[" * 100_000, "nested too deeply"),
    "a plan nested without end": ("m.plan", lambda: b"[" * 1_000_000, "lists within lists"),
    "a number of 5000 digits in a plan": ("m.plan", lambda: b'{"fileType": ' + b"9" * 5000 + b"}", "not valid JSON"),
    "settings nested without end": ("s.toml", lambda: b"a = " + b"[" * 100_000, "not valid TOML"),
    "settings of 5000 digits": ("s.toml", lambda: b"a = " + b"9" * 5000, "not valid TOML"),
    "settings without end": ("s.toml", lambda: b"# \n" * 1_000_000, "larger than"),
    "a map of 10^9 fields": ("big.png", lambda: png_of(31623, 31623), "more than 25000000 fields"),
    "a map of 10^9 fields, PGM": ("big.pgm", lambda: b"P5\n31623 31623\n255\n", "more than 25000000 fields"),
    "a map of 10^9 fields, MovingAI": (
        "big.map",
        lambda: b"type octile\nheight 31623\nwidth 31623\nmap\n",
        "more than 25000000 fields",
    ),
    "a map of 10^18 fields": (
        "big.map",
        lambda: b"type octile\nheight 999999999\nwidth 999999999\nmap\n",
        "more than 25000000 fields",
    ),
}


@pytest.fixture(scope="module")
def check(tmp_path_factory: pytest.TempPathFactory) -> Callable[[list[list[str]]], list[tuple[int, str]]]:
    """Runs commands in a process that may not take much memory; exit code and output of each."""
    code = (
        "import json, resource, sys\n"
        "from typer.testing import CliRunner\n"
        "from companion.cli.commands import app\n"
        "from companion.cli import mission, plan, run  # loaded before memory is scarce\n"
        "pages = int(open('/proc/self/statm').read().split()[0]) * resource.getpagesize()\n"
        f"resource.setrlimit(resource.RLIMIT_AS, (pages + {MEMORY_BYTES},) * 2)\n"
        "for line in sys.stdin:\n"
        "    result = CliRunner().invoke(app, json.loads(line))\n"
        "    print(json.dumps([result.exit_code, result.output + repr(result.exception or '')]))\n"
    )

    def run(commands: list[list[str]]) -> list[tuple[int, str]]:
        import json

        text = "".join(json.dumps(command) + "\n" for command in commands)
        done = subprocess.run(
            [sys.executable, "-c", code], input=text, capture_output=True, text=True, timeout=120, check=True
        )
        return [tuple(json.loads(line)) for line in done.stdout.splitlines()]

    return run


def test_hostile_sizes_are_refused_in_one_line_and_little_memory(
    tmp_path: Path, check: Callable[[list[list[str]]], list[tuple[int, str]]]
) -> None:
    good = mission_path(yard(tmp_path))
    commands = []
    for number, (name, data, _) in enumerate(HOSTILE.values()):
        folder = tmp_path / f"{number}"
        folder.mkdir()
        (folder / name).write_bytes(data())
        if name.startswith("m."):
            commands.append(["mission", "check", str(folder / name)])
        elif name.startswith("s."):
            commands.append(["run", str(good), "--connect", "tcp:127.0.0.1:9", "--settings", str(folder / name)])
        else:
            commands.append(["plan", str(folder / name), "--start", "0,0", "--target", "5,5"])
    results = check(commands)
    for (what, (name, _, words)), (code, output) in zip(HOSTILE.items(), results, strict=True):
        lines = output.replace("SystemExit(2)", "").strip().splitlines()
        assert (code, len(lines)) == (2, 1), (what, output[:2000])
        assert words in lines[0] and name in lines[0] and len(lines[0]) < 1000, (what, lines)


# --- floods ----------------------------------------------------------------------------------------------------------

TICK_HZ = 20


def packed(message: mavlink.MAVLink_message, system: int = 1, component: int = 158, sequence: int = 0) -> bytes:
    mav = mavlink.MAVLink(None, system, component)
    mav.seq = sequence % 256
    return bytes(message.pack(mav))


def adsb(n: int) -> bytes:
    return packed(
        mavlink.MAVLink_adsb_vehicle_message(n, 530000000 + n, 230000000, 0, 0, 0, 0, 0, b"X", 0, 0, 0xFFFF, 0)
    )


def reposition(n: int) -> bytes:
    wish = mavlink.MAVLink_command_int_message(1, 191, 6, 192, 0, 0, 0, 0, 0, 0, 530000000 + 99 * n, 230000000, 0)
    return packed(wish, 255, 190, n)


def other_systems(n: int) -> bytes:
    place = mavlink.MAVLink_global_position_int_message(n, 530000000 + n, 230000000, 0, 0, 0, 0, 0, 0)
    return packed(place, 2 + n % 250, 1)


def texts(n: int) -> bytes:
    return packed(mavlink.MAVLink_statustext_message(6, b"flood %d" % n), 1, 1, n)


def list_parameters(n: int) -> bytes:
    return packed(mavlink.MAVLink_param_request_list_message(1, 191), 255, 190, n)


def set_parameters(n: int) -> bytes:
    return packed(mavlink.MAVLink_param_set_message(1, 191, b"NONE%d" % (n % 1000), 1.0, 9), 255, 190, n)


def nonsense(n: int) -> bytes:
    return b"\xfd" * 40


def told_parameters(n: int) -> bytes:
    """Never the same name twice."""
    return packed(mavlink.MAVLink_param_value_message(b"X%d" % n, float(n), 9, 1000, n % 1000), 1, 1, n)


def lidar(n: int) -> bytes:
    """A second one that sees nothing at all, far too often."""
    return packed(mavlink.MAVLink_obstacle_distance_message(n, 0, [801] * 72, 5, 20, 800), 1, 158, n)


def beams(n: int) -> bytes:
    return packed(mavlink.MAVLink_distance_sensor_message(n, 20, 800, 800, 0, n % 250, n % 8, 0), 1, 159, n)


FLOODS = [
    adsb,
    reposition,
    other_systems,
    texts,
    list_parameters,
    set_parameters,
    told_parameters,
    lidar,
    beams,
    nonsense,
]


@pytest.mark.thorough
def test_a_thousand_messages_a_second_do_not_keep_it_from_its_mission(tmp_path: Path) -> None:
    """Of all kinds in turn."""
    rig = Rig(yard(tmp_path))
    rig.until_driven(1.0)
    count = 0

    def flooded(data: bytes) -> bytes:
        nonlocal count
        count += 1000 // TICK_HZ
        return data + b"".join(FLOODS[n % len(FLOODS)](n) for n in range(count - 1000 // TICK_HZ, count))

    before, said = len(rig.sent), len(rig.texts())
    began_s = rig.now_s()
    rig.garble = flooded
    tracemalloc.start()
    rig.run_for(1.0)
    rig.sent.clear()
    first, _ = tracemalloc.get_traced_memory()
    rig.run_for(2.0)
    sent_hz = len(rig.sent) / 2.0
    rig.sent.clear()
    grown = tracemalloc.get_traced_memory()[0] - first
    tracemalloc.stop()
    rig.finish()
    assert rig.companion.outcome.complete and not rig.simulator.collisions, rig.texts()
    assert before and count >= 3000 and rig.now_s() - began_s < 40.0
    assert grown < 1_000_000
    assert sent_hz < 120.0, "it does not answer a flood with a flood"
    assert len(rig.texts()) - said < 200, rig.texts()


def test_range_data_at_a_thousand_a_second_is_not_mapped_so_often_and_parameters_are_not_hoarded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Work is counted, not time: of one sensor at most three a tick, and the rover's own lidar ten times a second."""
    mapped = []
    rig = Rig(yard(tmp_path))
    rig.until_driven(1.0)
    take = MissionExecutor.map_scan

    def counted(*given: Any) -> None:
        mapped.append(given)
        take(*given)

    monkeypatch.setattr(MissionExecutor, "map_scan", counted)
    rig.garble = lambda data: data + b"".join(map(lidar, range(50))) + b"".join(map(told_parameters, range(50)))
    rig.run_for(1.0)
    assert 0 < len(mapped) <= 3 * TICK_HZ + 3 + 12
    assert set(rig.companion.vehicle.parameters) <= PARAMETERS_KEPT


@pytest.mark.thorough
@first_of(
    1, ("flood", "hz"), [(lidar, 20), pytest.param(lidar, 40, marks=pytest.mark.thorough), (lidar, 1000), (beams, 1000)]
)
def test_a_sensor_that_sees_nothing_far_too_often_does_not_hide_the_wall_from_the_one_that_sees_it(
    tmp_path: Path, flood: Callable[[int], bytes], hz: int
) -> None:
    rig = Rig(yard(tmp_path))
    rig.until_driven(1.0)
    count = 0

    def flooded(data: bytes) -> bytes:
        nonlocal count
        count += hz // TICK_HZ
        return data + b"".join(flood(n) for n in range(count - hz // TICK_HZ, count))

    rig.garble = flooded
    rig.finish(60.0)
    assert rig.companion.outcome.complete and not rig.simulator.collisions, rig.texts()


def test_another_vehicle_under_the_rovers_own_ids_is_not_heeded_and_told_once(tmp_path: Path) -> None:
    """A copter that somebody has left at system id 1, armed and in a mode whose number is MANUAL's."""
    rig = Rig(yard(tmp_path))
    rig.until_driven(1.0)
    beat = mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, 81, 0, 4, 3
    )
    rig.garble = lambda data: data + packed(beat, 1, 1, 77)
    rig.finish()
    assert rig.companion.outcome.complete
    told = [text for text in rig.texts() if "type 2 speaks as system 1" in text]
    assert len(told) == 1 and "MAV_SYSID" in told[0]


# --- files -----------------------------------------------------------------------------------------------------------

WATCHER = """
import os, sys
allowed = tuple(os.path.realpath(place) + os.sep for place in {places!r}) + ('/dev/', '/proc/')
WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
NAMED = {{'os.mkdir': (0,), 'os.remove': (0,), 'os.rmdir': (0,), 'os.rename': (0, 1), 'os.link': (0, 1),
         'os.symlink': (0, 1), 'os.truncate': (0,), 'os.chmod': (0,), 'shutil.copyfile': (1,),
         'tempfile.mkstemp': (0,), 'tempfile.mkdtemp': (0,)}}
def hook(event, arguments):
    if event in ('open', 'os.mkdir') and os.path.isdir(arguments[0]):
        return  # no file, or one without a name: with that the compiler's cache tries whether it could be written
    if event == 'open' and isinstance(arguments[0], (str, bytes)) and arguments[2] & WRITES:
        places = arguments[:1]
    elif event in NAMED:
        places = [arguments[i] for i in NAMED[event] if isinstance(arguments[i], (str, bytes))]
    else:
        return
    for place in places:
        if '__pycache__' in os.fsdecode(place):
            continue  # compiled kernels have a place of their own, here beside the sources
        if not (os.path.realpath(os.fsdecode(place)) + os.sep).startswith(allowed):
            print('WRITTEN', event, os.fsdecode(place), file=sys.stderr, flush=True)
            os._exit(66)
sys.addaudithook(hook)
"""


def tree(folder: Path) -> dict[str, tuple[int, int]]:
    """Every file with its size and time."""
    found = {}
    for path in sorted(folder.rglob("*")):
        status = path.lstat()
        found[str(path.relative_to(folder))] = (status.st_size, status.st_mtime_ns)
    return found


def watched(place: Path, allowed: list[Path], *arguments: object) -> tuple[int, str, str]:
    """A command in a read-only directory; its interpreter ends it when it writes elsewhere than allowed."""
    environment = {**os.environ, "HOME": str(place / "home"), "XDG_STATE_HOME": str(allowed[-1])}
    # What the library of the pictures keeps of fonts.
    environment["MPLCONFIGDIR"] = str(allowed[-1] / "matplotlib")
    first = WATCHER.format(places=[str(path) for path in allowed])
    with Forked("companion", arguments, environment, place, first) as child:
        return finished(child)


@pytest.mark.thorough
@pytest.mark.slow
def test_no_file_is_written_outside_of_record_and_state(tmp_path: Path) -> None:
    place, record, state = tmp_path / "place", tmp_path / "record", tmp_path / "state"
    (place / "home").mkdir(parents=True)
    mission = yard(place)
    before = tree(place)
    os.chmod(place, 0o555)
    try:
        with served(mission) as world:
            done = watched(
                place, [record, state], "run", "yard.toml", "--connect", world.url, "--arm", "--record", record
            )
        assert done[0] == 0, done[2]
        assert "gate: reached" in done[1]
        again = watched(place, [record, state], "replay", record, "--why", "2")
        assert again[0] == 0, again[2]
    finally:
        os.chmod(place, 0o755)
    assert tree(place) == before
    assert (record / "why-2.png").exists() and any(state.rglob("*"))


@pytest.mark.thorough
def test_the_watcher_sees_what_is_written_elsewhere(tmp_path: Path) -> None:
    mission = yard(tmp_path)
    code, _, said = watched(
        tmp_path, [tmp_path / "record"], "plan", "yard.png", "--start", "1,1", "--target", "3,3", "--image", "p.png"
    )
    assert mission.source is not None
    assert code == 66 and "WRITTEN open" in said
