"""Report data: what a report holds of a record: frames and tiles of the run made again, its decisions, and tables.

Nouns: report data.
"""

from __future__ import annotations

import base64
import json
import math
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.app import Companion
from companion.core.grid import Cell
from companion.navigation.field_step import Decision
from companion.recording.contacts import contacts_of
from companion.recording.reader import Record
from companion.recording.record_format import PACKETS, STAMP
from companion.replay.explain import Candidate, DecisionExplainer, Explanation, explanation_lines
from companion.replay.replay import ReplayObserver, ReplayResult, replay
from companion.safety.reasons import RunPhase
from companion.storage.files import open_file
from companion.viewer.frame import frame_of, news_of, scene_of
from companion.viewer.map_tiles import TileWatch
from companion.viewer.wire import tile_message

FRAME_S, PATH_S, TILES_S = 0.4, 1.2, 1.0
"""So often each is kept."""
MOST_PLACES = 120
"""Of a candidate."""
SIMULATED_UNTIL_S = 1_600_000_000.0
"""September 2020: simulated time begins with that year."""
STOOD = (RunPhase.STOPPED, RunPhase.STOPPED_AND_WAITING, RunPhase.WAITING, RunPhase.WAY_BLOCKED)

Json = dict[str, Any]


def report_data(record: Record, others: list[Record]) -> Json:
    """Everything that the page shows. ``others``: only their tracks. Raises RecordError if a record is damaged."""
    watched = _Watched(record)
    result = replay(record, watched)
    contacts = _contacts(record.directory, watched.began_s, watched.start)
    for frame in watched.frames:
        frame["contacts"] = sum(one["t"] <= frame["t"] for one in contacts)
    day_s = _time_of_day(record)
    scene = {
        "live": False,
        "simulated": day_s is None,
        "began_unix_s": day_s,
        "may_act": False,
        "versions": dict(record.meta.versions),
        "settings": dict(record.meta.settings),
    }
    return {
        "scene": {**watched.scene, **scene},
        "frames": watched.frames,
        "tiles": watched.tiles,
        "decisions": watched.decisions,
        "contacts": contacts,
        "tables": [watched.targets_table(), watched.sums_table(result), watched.stops_table()],
        "others": [_other(one) for one in others],
    }


def _time_of_day(record: Record) -> float | None:
    """When the run began, in seconds since 1970; None if its time was simulated, which begins with the year 2020."""
    with open_file(record.directory / PACKETS) as file:
        began_s = 1e-6 * int.from_bytes(file.read(STAMP.size), "big")
    return round(began_s, 1) if began_s > SIMULATED_UNTIL_S else None


def _contacts(directory: Path, began_s: float, start: tuple[float, float]) -> list[Json]:
    try:
        found = contacts_of(directory)
    except (OSError, ValueError):
        return []  # ``replay`` says what is wrong with it
    return [
        {
            "t": round(one["time_s"] - began_s, 2),
            "place": [one["north_m"] + start[0], one["east_m"] + start[1]],
            "speed": one["speed_m_s"],
            "what": one["with"],
        }
        for one in found
    ]


def _other(record: Record) -> Json:
    """Another record's track."""
    track = _Track()
    replay(record, track)
    return {"name": record.directory.name, "track": track.places}


class _Track(ReplayObserver):
    """Where the rover was: time, north and east."""

    def __init__(self) -> None:
        self.places: list[tuple[float, float, float]] = []

    def ticked(self, companion: Companion, time_s: float) -> None:
        """See ``ReplayObserver``."""
        pose = companion.status().pose
        if pose is not None and (not self.places or time_s - self.places[-1][0] >= FRAME_S - 1e-6):
            self.places.append((round(time_s, 2), round(pose.north_m, 2), round(pose.east_m, 2)))


class _Watched(ReplayObserver):
    """Looks at a companion that is run again."""

    def __init__(self, record: Record) -> None:
        self.scene: Json = {}
        self.frames: list[Json] = []
        self.tiles: list[tuple[float, str]] = []
        self.decisions: list[Json] = []
        self.began_s = 0.0
        self._start: tuple[float, float] | None = None
        self._mission = record.mission
        turning_radius_m = record.mission.rover.turning_radius_m
        self._explainer = DecisionExplainer(None, record.settings, turning_radius_m, self._explained)
        self._before: Json = {}
        self._news: list[Json] = []
        self._frame_s = self._path_s = self._tiles_s = -math.inf
        self._watch: TileWatch | None = None
        self._evidence: object = None
        self._stood_s: defaultdict[str, float] = defaultdict(float)
        self._stops: Counter[str] = Counter()
        self._doing, self._last_s = "", 0.0
        self._driven_m, self._moving_s = 0.0, 0.0
        self._reached_s: dict[int, float] = {}
        self._statuses: list[tuple[str, str]] = []

    @property
    def start(self) -> tuple[float, float]:
        """Where the rover was first: contacts count from there."""
        return self._start or (0.0, 0.0)

    def step_begins(self, companion: Companion) -> None:
        """See ``ReplayObserver``."""
        self._explainer.step_begins(companion)

    def decided(self, companion: Companion, number: int, time_s: float, target: str, decision: Decision) -> None:
        """See ``ReplayObserver``."""
        self._explainer.decided(companion, number, time_s, target, decision)

    def ticked(self, companion: Companion, time_s: float) -> None:
        """See ``ReplayObserver``."""
        status = companion.status()
        self.began_s = status.time_s - time_s
        self._news += [{**one, "t": round(time_s, 2)} for one in news_of(status)]
        self._count(companion, str(status.activity), status.activity.phase, time_s)
        if time_s - self._frame_s < FRAME_S - 1e-6 and not companion.done:
            return
        self._frame_s = time_s
        if self._start is None and status.pose is not None:
            self._start = status.pose.north_m, status.pose.east_m
        frame = frame_of(companion, status)
        frame.update({"t": round(time_s, 2), "news": self._news, "rates": {}})
        frame["figures"]["tick_ms"] = None  # of the replay, not of the run
        if time_s - self._path_s < PATH_S and frame["path"] and self._before.get("path"):
            frame["path"] = self._before["path"]
        else:
            self._path_s = time_s
        self._news = []
        self.frames.append({key: value for key, value in frame.items() if self._before.get(key, ...) != value})
        self.frames[-1]["t"] = frame["t"]
        self._before = frame
        self._take_map(companion, time_s)

    def _take_map(self, companion: Companion, time_s: float) -> None:
        executor, pose = companion.executor, companion.status().pose
        if executor is None or pose is None:
            return
        if executor.evidence is not self._evidence:
            self._evidence, self._watch = executor.evidence, TileWatch(executor.evidence)
            self.scene = scene_of(self._mission, companion.mission_run, 1)
        if self._watch is None or (time_s - self._tiles_s < TILES_S - 1e-6 and not companion.done):
            return
        self._tiles_s, seen = time_s, companion.vehicle.scan
        news = self._watch.changed(executor.evidence, pose.point, 0.0 if seen is None else seen.scan.max_range_m)
        if news:
            self.tiles.append((round(time_s, 2), base64.b64encode(tile_message(news)).decode()))

    def _count(self, companion: Companion, doing: str, phase: RunPhase, time_s: float) -> None:
        """Distance, and how long the rover stood for which reason."""
        step_s, self._last_s = time_s - self._last_s, time_s
        speed_m_s = companion.vehicle.speed_m_s
        if speed_m_s > 0.05:
            self._driven_m += speed_m_s * step_s
            self._moving_s += step_s
        if phase in STOOD:
            self._stood_s[doing] += step_s
            self._stops[doing] += doing != self._doing
        self._doing = doing
        self._statuses = [(name, str(status)) for name, status in companion.statuses()]
        for number, (_, status) in enumerate(self._statuses):
            if status == "reached":
                self._reached_s.setdefault(number, time_s)

    def _explained(self, why: Explanation) -> None:
        decision = why.decision
        self.decisions.append(
            {
                "number": why.number,
                "t": round(why.time_s, 2),
                "target": why.target,
                "action": str(decision.action),
                "part": str(decision.part),
                "reason": str(decision.reason),
                "lines": explanation_lines(why)[1:],
                "candidates": [_candidate(one, why) for one in why.candidates],
            }
        )

    def targets_table(self) -> Json:
        """What became of each target, and when."""
        rows = [
            [name, status, f"{self._reached_s[number]:.1f}" if number in self._reached_s else ""]
            for number, (name, status) in enumerate(self._statuses)
        ]
        return {"title": "Targets", "head": ["target", "status", "reached at s"], "rows": rows}

    def sums_table(self, result: ReplayResult) -> Json:
        """The whole run in figures."""
        mean = self._driven_m / self._moving_s if self._moving_s else 0.0
        rows = [
            ["time", f"{result.seconds:.1f} s"],
            ["driven", f"{self._driven_m:.1f} m"],
            ["mean speed while moving", f"{mean:.2f} m/s"],
            ["decisions", f"{result.decisions}"],
            ["packets heard", f"{result.heard}"],
            ["packets sent", f"{result.said}"],
            ["differences of the replay", f"{len(result.differences) or 'none'}"],
        ]
        return {"title": "The run", "head": ["", ""], "rows": rows}

    def stops_table(self) -> Json:
        """How long the rover stood, by reason."""
        longest = sorted(self._stood_s.items(), key=lambda one: -one[1])
        rows = [[doing, f"{self._stops[doing]}", f"{stood_s:.1f}"] for doing, stood_s in longest]
        return {"title": "Stops and waits", "head": ["reason", "times", "seconds"], "rows": rows}


def _candidate(candidate: Candidate, why: Explanation) -> Json:
    path, decision = candidate.path, why.decision
    taken = path is not None and not candidate.part_of and _ends_like(path.cell_array, decision.path)
    return {
        "name": candidate.name,
        "note": candidate.note,
        "cost": None if not math.isfinite(candidate.cost) else round(candidate.cost, 3),
        "taken": taken,
        "cells": [] if path is None else _thinned(why.grid.places_of(path.cell_array.astype(np.float64))),
        "curve": None if path is None or path.curve is None else _thinned(why.grid.places_of(path.curve)),
    }


def _ends_like(cells: NDArray[np.int64], taken: tuple[Cell, ...]) -> bool:
    """Whether these are the fields of the path that was taken, which begins where the rover is."""
    count = len(taken)
    return 0 < count <= len(cells) and np.array_equal(cells[len(cells) - count :], np.asarray(taken))


def _thinned(places: NDArray[np.float64]) -> list[list[float]]:
    if len(places) > MOST_PLACES:
        places = places[np.linspace(0, len(places) - 1, MOST_PLACES).astype(int)]
    rounded: list[list[float]] = np.round(places, 2).tolist()
    return rounded


def as_json(data: Json) -> bytes:
    """The data as JSON. Raises ValueError if there is a value that is no number."""
    return json.dumps(data, allow_nan=False, separators=(",", ":")).encode()
