"""Reads the table of measured facts (``sheet.txt``) and plays its rows against a simulator, as MAVLink packets.

A line of the table is ``name | state | sent | answers | texts | afterwards``:

- state: time of the first packet, then a mode (set at that time), ``armed``, ``PARAMETER=value``, ``sensors=SUITE``,
``wall`` (9 m north), ``post`` (1 m wide, 5.5 m north), ``as=SYSTEM/COMPONENT``, ``facing=DEGREES``. - sent, by ``;``:
``LONG n p1..p7``, ``INT n field=value..``, ``LOCAL frame mask field=value..``, ``GLOBAL ...``, ``KIND
field=value..``, ``wait s``, ``x10 0.5 ...`` (ten times, every 0.5 s), ``@255/190 ...`` (somebody else, on a link of
its own), ``forget``. - answers, in order: ACCEPTED, ... for COMMAND_ACK; other kinds by name with their first telling
field; ``-`` for none at all. - texts, by ``//``: ``severity text`` or ``severity beginning...``; ``-`` for none at
all; ``*`` for any that may follow. - afterwards, by ``;``: ``+s`` lets time pass; ``still``; ``value=number``, with
``~tolerance``, ``<`` or ``>``. A value is one of VALUES, ``n(KIND)`` (received since the last ``+`` or ``forget``),
``KIND.field`` or ``KIND.field.number`` (of the newest).
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.simulator import Simulator
from sitl.world.truth import SimStart
from sitl.world.world import World
from tests.support.sitl_client import HOME, Client

SHEET = Path(__file__).with_name("sheet.txt")
READY_S = 43.2
PLACE = {"lat_int": -353632075, "lon_int": 1491652300}
"""Six metres north of home, and 0.01 m east."""

MODES = {
    "MANUAL": 0, "ACRO": 1, "STEERING": 3, "HOLD": 4, "LOITER": 5, "SIMPLE": 7, "CIRCLE": 9, "AUTO": 10,
    "RTL": 11, "SMART_RTL": 12, "GUIDED": 15,
}  # fmt: skip
RESULTS = ("ACCEPTED", "TEMPORARILY_REJECTED", "DENIED", "UNSUPPORTED", "FAILED", "IN_PROGRESS")
ANSWERS = {
    "MISSION_ACK": "type", "MISSION_COUNT": "count", "MISSION_REQUEST": "seq", "MISSION_REQUEST_INT": "seq",
    "MISSION_ITEM_INT": "seq", "MISSION_ITEM": "seq", "PARAM_VALUE": "param_value", "MESSAGE_INTERVAL": "interval_us",
    "AUTOPILOT_VERSION": "", "HOME_POSITION": "", "GPS_GLOBAL_ORIGIN": "", "TIMESYNC": "ts1", "COMMAND_ACK": "result",
}  # fmt: skip
"""Kinds that are only sent when somebody asked, and the field that tells the answer."""

VALUES: dict[str, Callable[[Play], float]] = {
    "north": lambda play: play.truth.north_m,
    "east": lambda play: play.truth.east_m,
    "speed": lambda play: play.truth.speed_m_s,
    "heading": lambda play: math.degrees(play.truth.heading_rad),
    "turning": lambda play: math.degrees(play.truth.yaw_rate_rad_s),
    "mode": lambda play: play.newest["HEARTBEAT"].custom_mode,
    "armed": lambda play: play.newest["HEARTBEAT"].base_mode >> 7,
    "collisions": lambda play: len(play.client.simulator.collisions),
    "dropped": lambda play: play.client.link.dropped,
}


@dataclass(frozen=True)
class Row:
    """One line of the table, and the headings above it."""

    section: str
    area: str
    name: str
    state: str
    sent: tuple[str, ...]
    answers: str
    texts: str
    afterwards: tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.section}: {self.name}"


def split(text: str, by: str = ";") -> tuple[str, ...]:
    """The parts of a column, without blanks and empty ones."""
    return tuple(part.strip() for part in text.split(by) if part.strip())


def read_rows(path: Path = SHEET) -> list[Row]:
    """All rows; ``== section == area`` lines name what follows, ``name{a,b}`` with ``$`` makes a row of each."""
    rows, section, area = [], "", ""
    for line in path.read_text().splitlines():
        if line.startswith("=="):
            section, area = (part.strip() for part in line.strip("= ").partition("==")[::2])
        elif line.strip() and not line.startswith("#"):
            each = re.search(r"\{(.*?)\}", line.split("|")[0])
            for value in split(each[1], ",") if each else ("",):
                text = line.replace(each[0], f"[{value}]", 1).replace("$", value) if each else line
                name, state, sent, answers, texts, afterwards = (column.strip() for column in text.split("|"))
                rows.append(Row(section, area, name, state, split(sent), answers, texts, split(afterwards)))
    return rows


@dataclass
class Play:
    """A row under way: the client, further clients, the rover's position before, the messages since then."""

    client: Client
    stood: Any
    others: dict[str, Client] = field(default_factory=dict)
    heard: list[Any] = field(default_factory=list)
    newest: dict[str, Any] = field(default_factory=dict)

    @property
    def truth(self) -> Any:
        """Where the rover really is."""
        return self.client.simulator.truth

    def run(self, seconds: float) -> None:
        """Let time pass for everybody."""
        fresh = self.client.run_for(seconds)
        self.heard += fresh
        # Others' heartbeats come, too; the vehicle's state is told by component 1.
        told = [one for one in fresh if one.get_srcComponent() == 1 or one.get_type() != "HEARTBEAT"]
        self.newest |= {message.get_type(): message for message in told}
        for other in self.others.values():
            other.run_for(0.0)

    def do(self, step: str) -> None:
        """Carry out one step of the ``sent`` column."""
        word, _, rest = step.partition(" ")
        if word == "wait":
            self.run(float(rest))
        elif word == "forget":
            self.heard.clear()
        elif repeat := re.fullmatch(r"x(\d+)", word):
            every_s, _, inner = rest.partition(" ")
            for _ in range(int(repeat[1])):
                self.say(inner)
                self.run(float(every_s))
        else:
            self.say(step)
            self.run(0.1)

    def say(self, text: str) -> None:
        """Send one packet, as the client or as somebody else."""
        who, identity = self.client, re.match(r"@(\d+)/(\d+) ", text)
        if identity:
            text = text[identity.end() :]
            if identity[0] not in self.others:
                self.others[identity[0]] = Client(self.client.simulator, int(identity[1]), int(identity[2]))
            who = self.others[identity[0]]
        who.send(packet(text))


def packet(text: str) -> Any:
    """A message from its description; what is not said is zero, and meant for the autopilot."""
    word, *rest = text.split()
    if word == "LONG":
        numbers = [float(value) for value in rest[1:]]
        return mavlink.MAVLink_command_long_message(1, 1, int(rest[0]), 0, *numbers, *[0.0] * (7 - len(numbers)))
    values: dict[str, Any] = {"target_system": 1, "target_component": 1}
    if word == "INT":
        word, values = "COMMAND_INT", {**values, "command": rest.pop(0)}
    elif word in ("LOCAL", "GLOBAL"):
        values |= {"coordinate_frame": rest.pop(0), "type_mask": rest.pop(0)}
        values |= PLACE if word == "GLOBAL" else {}
        word = {"LOCAL": "SET_POSITION_TARGET_LOCAL_NED", "GLOBAL": "SET_POSITION_TARGET_GLOBAL_INT"}[word]
    values |= dict(item.split("=") for item in rest)
    kind = next(kind for kind in mavlink.mavlink_map.values() if kind.msgname == word)
    assert set(values) - {"target_system", "target_component"} <= set(kind.fieldnames), text
    return kind(*[typed(values.get(name, 0), kind, at) for at, name in enumerate(kind.fieldnames)])


def typed(value: Any, kind: Any, at: int) -> Any:
    """A field's value in its type; an array is filled with the one value."""
    name = kind.fieldtypes[at]
    if name == "char":
        return str(value or "").encode()
    number: Any = float(value) if name in ("float", "double") else int(value)
    length = kind.array_lengths[kind.ordered_fieldnames.index(kind.fieldnames[at])]
    return [number] * length if length else number


def start(row: Row) -> Play:
    """The simulator in the row's state: booted, in its mode, armed."""
    seconds, *words = row.state.split() or ["ready"]
    options = {key: value for key, _, value in (word.partition("=") for word in words) if value}
    identity = tuple(int(part) for part in options.pop("as", "1/191").split("/"))
    heading_rad = math.radians(float(options.pop("facing", 0)))
    sensors = options.pop("sensors", "none")
    world = World.open()
    place = (0.0, 0.0)
    if "wall" in words:
        obstacles = np.zeros((20, 40), dtype=np.bool_)
        obstacles[14:16, :] = True
        world, place = World(obstacles), (5.0, 20.0)
    elif "post" in words:
        obstacles = np.zeros((40, 40), dtype=np.bool_)
        obstacles[25, 20] = True
        world, place = World(obstacles), (19.5, 20.5)
    parameters = {name: float(value) for name, value in options.items()}
    simulator = Simulator(world, SimStart(*place, heading_rad, HOME), sensors, noise=False, parameters=parameters)
    # Whoever connects later need not take apart what is said while it starts: four fifths of the time.
    simulator.advance_to_s(READY_S if seconds == "ready" else float(seconds))
    client = Client(simulator, *identity)
    for word in words:
        if word in MODES:
            assert client.set_mode(MODES[word]) == 0
        elif word == "armed":
            assert client.arm() == 0
    return Play(client, simulator.truth)


def answers(messages: list[Any], asked: str) -> str:
    """What was answered, as the table writes it; parameters that nobody asked for, and our own TIMESYNC, are none."""
    found = []
    for message in messages:
        kind = message.get_type()
        if kind == "COMMAND_ACK":
            found.append(RESULTS[message.result])
        elif kind in ANSWERS and not (kind == "PARAM_VALUE" and message.param_id not in asked):
            if kind == "TIMESYNC" and message.tc1 == 0:
                continue
            telling = ANSWERS[kind]
            found.append(f"{kind} {getattr(message, telling):g}" if telling else kind)
    return ", ".join(found) or "-"


def texts(messages: list[Any]) -> list[str]:
    """What was said, chunks put together again."""
    said: list[str] = []
    for message in messages:
        if message.get_type() == "STATUSTEXT":
            if message.chunk_seq:
                said[-1] += message.text
            else:
                said.append(f"{message.severity} {message.text}")
    return said


def value_of(play: Play, name: str) -> float:
    """A value of the ``afterwards`` column."""
    if name in VALUES:
        return float(VALUES[name](play))
    if counted := re.fullmatch(r"n\((\w+)\)", name):
        return float(sum(message.get_type() == counted[1] for message in play.heard))
    kind, wanted, *number = name.split(".")
    if kind not in play.newest:
        return math.nan
    value = getattr(play.newest[kind], wanted)
    return float(value[int(number[0])] if number else value)


def holds(play: Play, check: str) -> bool:
    """Whether one check of the ``afterwards`` column is true."""
    if check == "still":
        now, then = play.truth, play.stood
        moved_m = math.hypot(now.north_m - then.north_m, now.east_m - then.east_m)
        return moved_m < 0.02 and abs(now.heading_rad - then.heading_rad) < 0.01
    parts = re.fullmatch(r"([\w.()]+)\s*([=<>])\s*(-?[\d.]+)(?:~([\d.]+))?", check)
    assert parts, check
    found, wanted = value_of(play, parts[1]), float(parts[3])
    if parts[2] == "=":
        return abs(found - wanted) <= float(parts[4] or 1e-6)
    return found < wanted if parts[2] == "<" else found > wanted


def said_as(wanted: tuple[str, ...], said: list[str]) -> bool:
    """Whether the texts are those of the table."""
    if wanted[-1:] == ("*",):
        wanted, said = wanted[:-1], said[: len(wanted) - 1]
    return len(wanted) == len(said) and all(
        one == other or (one.endswith("...") and other.startswith(one[:-3]))
        for one, other in zip(wanted, said, strict=True)
    )


def differences(row: Row) -> list[str]:
    """Play a row; what was not as the table says."""
    play, wrong = start(row), []
    for step in row.sent:
        play.do(step)
    answered = answers(play.heard, " ".join(row.sent))
    if answered != row.answers:
        wrong.append(f"answered {answered}, not {row.answers}")
    wanted = () if row.texts == "-" else split(row.texts, "//")
    if not said_as(wanted, texts(play.heard)):
        wrong.append(f"said {texts(play.heard)}, not {list(wanted)}")
    for check in row.afterwards:
        if check.startswith("+"):
            play.heard.clear()
            play.run(float(check[1:]))
        elif not holds(play, check):
            what = re.match(r"[\w.()]+", check)
            found = "moved" if check == "still" else f"{value_of(play, what[0] if what else check):.3f}"
            wrong.append(f"after: {check}, but {found}")
    return wrong
