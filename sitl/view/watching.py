"""Collects from a running simulator what ``--view`` shows: sketch, track, rates of links, events."""

from __future__ import annotations

import math
from array import array
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from companion.viewer.terminal.facts import NAME_COLUMNS, Fact, Section
from companion.viewer.terminal.screen import View
from companion.viewer.terminal.sketch import Disc, Kind, Layer, Place, PlaceState, Sketch, compass_word
from sitl.autopilot.control.records import LEG, WAYPOINT
from sitl.simulator import Simulator
from sitl.view.gps_fix import NO_GPS, fix_told
from sitl.world.world import World

TRACK_STEP_M = 0.2
TRACK_POINTS = 20_000
EVENTS_KEPT = 50
RATE_SPAN_S = 2.0
"""Shortest time over which rates are counted, in the rover's time."""


@dataclass
class Rates:
    """Messages per second of each link, from counters."""

    _seen: deque[tuple[float, dict[str, tuple[int, int]]]] = field(default_factory=deque)

    def update(self, now_s: float, counts: dict[str, tuple[int, int]]) -> dict[str, tuple[float, float]]:
        """Take in the counters of this moment (received, sent, by link); the rates over about ``RATE_SPAN_S``."""
        self._seen.append((now_s, counts))
        while len(self._seen) > 2 and now_s - self._seen[1][0] >= RATE_SPAN_S:
            self._seen.popleft()
        then_s, before = self._seen[0]
        span_s = max(now_s - then_s, 1e-3)
        rates = {}
        for name, (heard, sent) in counts.items():
            heard_then, sent_then = before.get(name, (0, 0))
            rates[name] = ((heard - heard_then) / span_s, (sent - sent_then) / span_s)
        return rates


class AutopilotState:
    """The autopilot at a moment: which boot it is, its mode, and whether it is armed."""

    def __init__(self, simulator: Simulator) -> None:
        self._boots = simulator.boots
        self.is_off = simulator.is_off
        self._mode = simulator.vehicle.mode.name
        self._armed = "armed" if simulator.vehicle.armed else "disarmed"

    def events_since(self, was: AutopilotState) -> Iterator[str]:
        """What has changed, one line each."""
        if self.is_off:
            if not was.is_off:
                yield "the autopilot has lost power"
        elif was.is_off or was._boots != self._boots:
            yield f"the autopilot has started anew: {self._mode}, {self._armed}"
        else:
            if self._mode != was._mode:
                yield f"mode {self._mode} now, {was._mode} before"
            if self._armed != was._armed:
                yield f"the rover is {self._armed} now"


@dataclass
class Watching:
    """Keeps what a single look at the simulator cannot show: the track, rates of links, events."""

    title: str
    simulator: Simulator
    events: deque[str] = field(default_factory=lambda: deque(maxlen=EVENTS_KEPT))
    _track: array[float] = field(default_factory=lambda: array("d"))
    _rates: Rates = field(default_factory=Rates)
    _began: tuple[float, float] | None = None
    _was: AutopilotState | None = None

    def tell(self, line: str) -> None:
        """Add an event."""
        self.events.append(line)

    def view(self, now_s: float) -> View:
        """The view of this moment; ``now_s``: real seconds."""
        sections = (self.vehicle_section(now_s), self.links_section())
        return View(self.title, self.sketch(), sections, tuple(self.events))

    def sketch(self) -> Sketch:
        """The true world, rover and track."""
        simulator, truth = self.simulator, self.simulator.truth
        self.note()
        world = simulator.world
        start = Place("start", simulator.start.north_m, simulator.start.east_m, PlaceState.START)
        return Sketch(
            layers=world_layers(world, simulator.time_s),
            rover=Disc(truth.north_m, truth.east_m, simulator.outline.reach_m),
            heading_rad=truth.heading_rad,
            track=self.track,
            movers=movers_of(world, simulator.time_s),
            places=(start, *self._destination()),
            bounds_m=bounds_of(world),
        )

    @property
    def track(self) -> NDArray[np.float64]:
        """The rover's track, shape (n, 2), north and east."""
        return np.array(self._track).reshape(-1, 2)

    def note(self) -> None:
        """Record the track, and changes of mode, arming and power; to be called often."""
        self._note_track()
        simulator = self.simulator
        was, now = self._was, AutopilotState(simulator)
        self._was = now
        for line in now.events_since(was) if was else ():
            self.tell(f"{simulator.time_s:.0f} s: {line}")

    def _note_track(self) -> None:
        truth = self.simulator.truth
        here = (truth.north_m, truth.east_m)
        if not self._track or math.dist(self._track[-2:], here) >= TRACK_STEP_M:
            self._track.extend(here)
            del self._track[: -2 * TRACK_POINTS]

    def _destination(self) -> tuple[Place, ...]:
        """The autopilot's destination, if any."""
        vehicle = self.simulator.vehicle
        goal = vehicle.control[0]
        if not vehicle.has_target or int(goal["task"]) not in (WAYPOINT, LEG):
            return ()
        north_m, east_m = float(goal["dest_n"]) + vehicle.origin_m[0], float(goal["dest_e"]) + vehicle.origin_m[1]
        return (Place("target", north_m, east_m),)

    def vehicle_section(self, now_s: float) -> Section:
        """Mode, motion and health."""
        simulator, truth = self.simulator, self.simulator.truth
        began = self._began = self._began or (now_s, simulator.time_s)
        times = (simulator.time_s - began[1]) / max(now_s - began[0], 1e-3)
        north_m, east_m = truth.north_m - simulator.start.north_m, truth.east_m - simulator.start.east_m
        facts = (
            Fact("mode", _mode(simulator), alarm=simulator.is_off),
            Fact("time", f"{simulator.time_s:.0f} s, {times:.1f} times"),
            Fact("speed", f"{truth.speed_m_s:.2f} m/s"),
            Fact(
                "heading",
                f"{math.degrees(truth.heading_rad) % 360.0:.0f}° {compass_word(truth.heading_rad)}",
                minor=True,
            ),
            Fact("position", f"N {north_m:.1f}, E {east_m:.1f} m", minor=True),
            *_health(simulator),
            Fact("driven", f"{simulator.driven_m:.0f} m", minor=True),
            Fact("collisions", _collisions(simulator), alarm=len(simulator.collisions) > 0),
        )
        return Section("Rover", facts)

    def links_section(self) -> Section:
        """Messages per second to and from each link."""
        counts = {link.name: (link.heard.packets, link.sent.packets) for link in self.simulator.links}
        rates = self._rates.update(self.simulator.time_s, counts)
        facts = [Fact("nobody is connected", "")] if not rates else []
        for name, (heard, sent) in rates.items():
            told = f"in {heard:.0f}/s, out {sent:.0f}/s"
            if len(name) < NAME_COLUMNS:
                facts.append(Fact(name, told, minor=True))
            else:
                facts += [Fact(name, "", minor=True), Fact("", told, minor=True)]
        return Section("Links", tuple(facts))


def _mode(simulator: Simulator) -> str:
    if simulator.is_off:
        return "no power"
    return f"{simulator.vehicle.mode.name}, {'armed' if simulator.vehicle.armed else 'disarmed'}"


def _collisions(simulator: Simulator) -> str:
    """How many, and the last one: when, how fast, with what."""
    if not simulator.collisions:
        return "0"
    last = simulator.collisions[-1]
    return f"{len(simulator.collisions)}, last at {last.time_s:.1f} s, {last.speed_m_s:.1f} m/s, {last.what}"


def _health(simulator: Simulator) -> tuple[Fact, ...]:
    """GPS, EKF, and the battery if it is monitored."""
    vehicle = simulator.vehicle
    fix = fix_told(vehicle)
    position = "position known" if vehicle.has_position else "no position"
    facts = [
        Fact("GPS", fix, alarm=fix == NO_GPS, minor=True),
        Fact("EKF", position, alarm=not vehicle.has_position, minor=True),
    ]
    if int(vehicle.parameters["BATT_MONITOR"]) != 0:
        facts.append(Fact("battery", f"{vehicle.volts():.1f} V, {vehicle.battery_percent()} %"))
    return tuple(facts)


def world_layers(world: World, time_s: float, standing: Kind = Kind.WALL) -> tuple[Layer, ...]:
    """The world at a moment; ``standing``: how ordinary obstacles are shown."""
    layers = []
    for kind, ground in zip((Kind.SLIPPERY, Kind.ROUGH), world.ground, strict=True):
        if ground.size:
            layers.append((kind, ground < 1.0))
    layers.append((standing, world.obstacles))
    for kind, special in ((Kind.GLASS, world.glass), (Kind.BLACK, world.black)):
        if special is not None:
            layers.append((kind, special & world.obstacles))
    layers += [(Kind.OPEN_DOOR if door.is_open(time_s) else Kind.DOOR, door.fields) for door in world.doors]
    frame = (world.resolution_m, world.south_m, world.west_m)
    return tuple(Layer(kind, where, *frame) for kind, where in layers)


def movers_of(world: World, time_s: float) -> tuple[Disc, ...]:
    """The moving obstacles at a moment."""
    places = (world.mover_at(number, time_s) for number in range(len(world.movers)))
    return tuple(
        Disc(north_m, east_m, mover.radius_m)
        for mover, (north_m, east_m, _, _) in zip(world.movers, places, strict=True)
    )


def bounds_of(world: World) -> tuple[float, float, float, float] | None:
    """South, west, north and east edges of a world; None for open ground."""
    if not (world.obstacles.any() or world.doors or world.ground.size):
        return None
    return (world.south_m, world.west_m, world.south_m + world.height_m, world.west_m + world.width_m)
