"""The view of a run: follows a companion tick by tick, and makes views of it.

What a tick hands over is small and does not change any more, but for the map: the drawing thread reads it while the
companion writes, so a dot may be one view too old.

Nouns: run view.
"""

from __future__ import annotations

import math
from array import array
from collections import deque

import numpy as np

from companion.app import Companion, Status
from companion.core.frames import NedPoint, Pose
from companion.viewer.arrivals import Arrivals
from companion.viewer.frame import mode_of
from companion.viewer.headway import Headway
from companion.viewer.last_place import knows_place
from companion.viewer.terminal.facts import Fact, Section
from companion.viewer.terminal.known import headline_of, known_layers, mission_section, path_ahead, target_places
from companion.viewer.terminal.painter import MakeView
from companion.viewer.terminal.screen import View
from companion.viewer.terminal.sketch import Disc, Place, PlaceState, Sketch, compass_word

TRACK_STEP_M, TRACK_POINTS = 0.2, 5_000
NEWS_KEPT = 50
HEARTBEAT_OLD_S, POSITION_OLD_S = 3.0, 1.5


class RunView:
    """``note`` in each tick; ``view`` when one is due."""

    def __init__(self, companion: Companion, name: str) -> None:
        self._companion = companion
        self._name = name
        self._news: deque[str] = deque(maxlen=NEWS_KEPT)
        self._track = array("d")
        self._pose: Pose | None = None
        """Where it was last known to be."""
        self._origin: object = None
        self._began_s: float | None = None
        self._arrivals, self._headway = Arrivals(), Headway()

    @property
    def is_over(self) -> bool:
        """Whether this is the last moment."""
        return self._companion.done

    def note(self, status: Status) -> None:
        """Keep the track, the news, and how often data arrive."""
        self._began_s = status.time_s if self._began_s is None else self._began_s
        self._headway.note(self._companion, status)
        texts = [*(one.text for one in status.news), *([self._headway.line] if self._headway.begins else ())]
        self._news += [f"{status.time_s - self._began_s:.0f} s: {text}" for text in texts]
        self._arrivals.note(self._companion.vehicle)
        if self._companion.origin != self._origin:
            self._origin = self._companion.origin
            del self._track[:]  # counted from elsewhere
            self._pose = None
        pose = status.pose if knows_place(self._companion.vehicle) else None
        self._pose = pose or self._pose
        if pose is not None and self._origin is not None:
            here = (pose.north_m, pose.east_m)
            if not self._track or math.dist(self._track[-2:], here) >= TRACK_STEP_M:
                self._track.extend(here)
                del self._track[: -2 * TRACK_POINTS]

    def tell(self, text: str) -> None:
        """One more line of news."""
        self._news.append(text)

    def view(self, status: Status) -> MakeView:
        """What makes the view of this moment, in any thread."""
        companion, pose = self._companion, self._pose
        executor, track = companion.executor, np.array(self._track).reshape(-1, 2)
        rover = None if pose is None or executor is None else Disc(pose.north_m, pose.east_m, 0.0)
        heading_rad = 0.0 if pose is None else pose.heading_rad
        moving = () if executor is None else tuple(executor.moving)
        movers = tuple(Disc(*_place(one.at(status.time_s)), one.radius_m) for one in moving)
        places: tuple[Place, ...] = ()
        if executor is not None:
            home = executor.progress.home.point
            targets = target_places(executor.progress, ended=companion.done)
            places = (Place("home", *_place(home), PlaceState.START), *targets)
        path, headline = path_ahead(companion), headline_of(companion, status, self._headway)
        sections = (self._rover_section(status), mission_section(companion, status), self._link_section(status))
        news, evidence, name = tuple(self._news), companion.evidence, self._name

        def make() -> View:
            layers = () if evidence is None or pose is None else known_layers(evidence, around=pose.point)
            sketch = Sketch(layers, rover, heading_rad, track, path, movers, places)
            return View(name, sketch, sections, news, headline)

        return make

    def _rover_section(self, status: Status) -> Section:
        companion, pose = self._companion, self._pose
        vehicle, mode = companion.vehicle, mode_of(companion.vehicle, companion.mission_run)
        armed = "armed" if mode["armed"] else "disarmed"
        rates = self._arrivals.at(vehicle, status.time_s)
        mute = _old(rates["heartbeat_age_s"], HEARTBEAT_OLD_S)
        facts = [
            Fact("mode", f"{mode['mode']}, {armed}{mute}" if mode["mode"] else "-", alarm=bool(mute)),
            Fact("driven by", f"{mode['drives']}{mute}", alarm=bool(mute)),
            self._speed(_old(rates["position_age_s"], POSITION_OLD_S)),
        ]
        if pose is not None:
            word, degrees = compass_word(pose.heading_rad), math.degrees(pose.heading_rad) % 360.0
            facts.append(Fact("heading", f"{degrees:.0f}° {word}", minor=True))
            known = "" if knows_place(vehicle) else ", last known"
            facts.append(Fact("position", f"N {pose.north_m:.1f}, E {pose.east_m:.1f} m{known}", minor=True))
        if vehicle.battery is not None and vehicle.battery.volts is not None:
            percent = "" if vehicle.battery.percent is None else f", {vehicle.battery.percent} %"
            facts.append(Fact("battery", f"{vehicle.battery.volts:.1f} V{percent}"))
        if vehicle.gps is not None:
            facts.append(Fact("GPS", f"{vehicle.gps.fix.text}, {vehicle.gps.satellites} satellites", minor=True))
        return Section("Rover", tuple(facts))

    def _speed(self, old: str) -> Fact:
        vehicle = self._companion.vehicle
        if vehicle.position is None:
            return Fact("speed", "-")
        return Fact("speed", f"{vehicle.forward_m_s:.2f} m/s{old}", alarm=bool(old))

    def _link_section(self, status: Status) -> Section:
        rates = self._arrivals.at(self._companion.vehicle, status.time_s)
        age_s = rates["heartbeat_age_s"]
        age = "none" if age_s is None else f"{age_s:.1f} s ago"
        facts = [
            Fact("heartbeat", age, alarm=age_s is None or age_s > HEARTBEAT_OLD_S),
            Fact("positions", f"{rates['position']:.0f} a second"),
            Fact("ranges", f"{rates['range']:.0f} a second"),
            Fact("latency", "-" if age_s is None else f"{1e3 * self._companion.vehicle.latency_s:.0f} ms", minor=True),
        ]
        return Section("Link", tuple(facts))


def _old(age_s: float | None, limit_s: float) -> str:
    """What is written behind a value that was true some time ago; empty for a fresh one."""
    return "" if age_s is None or age_s <= limit_s else f", {age_s:.0f} s ago"


def _place(point: NedPoint) -> tuple[float, float]:
    return point.north_m, point.east_m
