"""Report data: what a report holds of a record: frames and tiles of the run made again, its decisions, and tables.

Nouns: report data.
"""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.app import Companion, Status
from companion.core.grid import Cell
from companion.navigation.field_step import Decision, DecisionReason
from companion.recording.contacts import Contact, contacts_of
from companion.recording.reader import Record
from companion.recording.record_clock import record_clock
from companion.replay.explain import Candidate, DecisionExplainer, Explanation, explanation_lines
from companion.replay.replay import ReplayObserver, ReplayResult, replay
from companion.safety.reasons import EndReason, Reason
from companion.viewer.arrivals import Arrivals
from companion.viewer.frame import doing_of, end_of, frame_of, news_of, scene_of
from companion.viewer.headway import Headway
from companion.viewer.last_place import LastPlace
from companion.viewer.map_tiles import TileWatch
from companion.viewer.report_tables import Run, differences, tables_of
from companion.viewer.run_tally import RunTally
from companion.viewer.steady_frame import SteadyFrame
from companion.viewer.wire import tile_message

FRAME_S, PATH_S, TILES_S = 0.4, 1.2, 1.0
"""So often each is kept."""
LOOK_S = 2.5
"""Each look at the map is as long as one after so many seconds would be beside a drive: nobody waits here."""
GOES_ON = (DecisionReason.FOLLOWING, DecisionReason.NO_BETTER_PATH)
"""Decisions with which the rover goes on as before, like going back for the second time in a row."""
MOST_PLACES = 120
"""Of a candidate."""

Json = dict[str, Any]


def counted(record: Record, run_again: Callable[[Record, ReplayObserver], ReplayResult] = replay) -> Run:
    """A run, made again with ``run_again`` only to count. Raises RecordError."""
    tally = RunTally()
    return run_of(record, tally, run_again(record, tally))


def run_of(record: Record, tally: RunTally, result: ReplayResult) -> Run:
    """The run for tables. Only a simulator knows contacts."""
    found = _contacts(record.directory)
    known = found or record_clock(record).simulated
    return Run(str(record.directory), record.mission.name, tally, result, len(found) if known else None)


def named(runs: Sequence[Run]) -> list[Run]:
    """Runs by the last part of their names, where that is enough to tell them apart. The same one again is numbered."""
    short = [Path(run.name).resolve().name for run in runs]
    names = short if len(set(short)) == len(short) else [run.name for run in runs]
    turns = [names[: i + 1].count(name) for i, name in enumerate(names)]
    told = [name if turn == 1 else f"{name} ({turn})" for name, turn in zip(names, turns, strict=True)]
    return [replace(run, name=name) for run, name in zip(runs, told, strict=True)]


def joined(record: Record, watched: ReportWatch, run: Run, others: list[Run]) -> Json:
    """The parts of a report, put together."""
    if run.result.companion is not None:
        watched.end(run.result.companion, run.result.seconds, record.meta.end_reason)
    contacts = [
        {
            "t": round(one["time_s"] - watched.began_s, 2),
            "place": [one["north_m"] + watched.start[0], one["east_m"] + watched.start[1]],
            "speed": one["speed_m_s"],
            "what": one["with"],
        }
        for one in _contacts(record.directory)
    ]
    clock = record_clock(record)
    for frame in watched.frames if clock.simulated else ():
        frame["contacts"] = sum(one["t"] <= frame["t"] for one in contacts)
    scene = {
        "live": False,
        "cut": not record.complete,
        "simulated": clock.simulated,
        "began_unix_s": None if clock.simulated else round(1e-6 * clock.began_us, 1),
        "may_act": False,
        "versions": dict(record.meta.versions),
        "settings": dict(record.meta.settings),
    }
    return {
        "scene": {**watched.scene, **scene},
        "frames": watched.frames,
        "maps": watched.maps,
        "tiles": watched.tiles,
        "decisions": watched.decisions,
        "contacts": contacts,
        "tables": [*([differences([run, *others])] if others else []), *tables_of(run)],
        "others": [
            {"name": one.name, "track": one.tally.track, "elsewhere": one.mission != run.mission} for one in others
        ],
    }


def _contacts(directory: Path) -> list[Contact]:
    try:
        return contacts_of(directory)
    except (OSError, ValueError):
        return []  # ``replay`` says what is wrong with it


class ReportWatch(ReplayObserver):
    """Looks at a companion that is run again, and keeps frames, tiles and decisions."""

    def __init__(self, record: Record) -> None:
        self.scene: Json = {"mission": record.mission.name}
        self.frames: list[Json] = []
        self.tiles: list[tuple[float, str]] = []
        self.decisions: list[Json] = []
        self.began_s = 0.0
        self._start: tuple[float, float] | None = None
        self._mission = record.mission
        turning_radius_m = record.mission.rover.turning_radius_m
        self._explainer = DecisionExplainer(None, record.settings, turning_radius_m, self._explained)
        self._reason: DecisionReason | None = None
        self._before: Json = {}
        self._rates = Arrivals()
        self._news: list[Json] = []
        self._frame_s = self._path_s = self._tiles_s = -math.inf
        self._watch: TileWatch | None = None
        self._evidence: object = None
        self._steady, self._last_place, self._headway = SteadyFrame(), LastPlace(), Headway()
        self.maps: list[tuple[float, Json | None]] = []
        """From when on which map is shown: another one begins where the companion begins it anew."""

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
        if decision.new_path is not None:  # who goes to this decision is to see where it leads
            self._frame_s = self._path_s = -math.inf

    def ticked(self, companion: Companion, time_s: float) -> None:
        """See ``ReplayObserver``."""
        status = companion.status()
        self._rates.note(companion.vehicle)
        self.began_s = status.time_s - time_s
        self._headway.note(companion, status)
        self._news += [{**one, "t": round(time_s, 2)} for one in news_of(status, self._headway)]
        if time_s - self._frame_s >= FRAME_S - 1e-6 or companion.done:
            self._frame_s = time_s
            self._keep(companion, status, time_s)
            self._take_map(companion, time_s, whole=companion.done)
        elif self._headway.begins or doing_of(companion, status, self._headway)["state"] != self._before["state"]:
            self._keep(companion, status, time_s)  # however short it is, what the tables count is to be seen

    def end(self, companion: Companion, time_s: float, reason: EndReason | None) -> None:
        """The record ends here, perhaps between two frames, and perhaps in the middle of the drive."""
        if not self.frames or round(time_s, 2) > self.frames[-1]["t"]:
            self._keep(companion, companion.status(), time_s)
        self._take_map(companion, time_s, whole=True)
        if reason is not None and self._before["state"] != "ended":
            self.frames[-1].update(end_of(companion, Reason(reason)))

    def _keep(self, companion: Companion, status: Status, time_s: float) -> None:
        """A frame of this moment, without what has not changed since the last one."""
        places = companion.mission_run.places
        self._steady.note(None if places is None else places.origin)
        if self._start is None and status.pose is not None:
            self._start = status.pose.north_m, status.pose.east_m
        frame = self._steady.frame(frame_of(companion, status, self._headway))
        frame.update({"t": round(time_s, 2), "news": self._news})
        frame["rates"] = self._rates.at(companion.vehicle, status.time_s)
        frame = self._last_place.told(frame, companion.vehicle, status.time_s)
        frame["figures"].update(tick_ms=None, planning_ms=None)  # of the replay, not of the run
        if time_s - self._path_s < PATH_S and frame["path"] and self._before.get("path"):
            frame["path"] = self._before["path"]
        else:
            self._path_s = time_s
        self._news = []
        self.frames.append({key: value for key, value in frame.items() if self._before.get(key, ...) != value})
        self.frames[-1]["t"] = frame["t"]
        self._before = frame

    def _take_map(self, companion: Companion, time_s: float, *, whole: bool) -> None:
        """What has changed on it. ``whole``: all of that."""
        executor, pose = companion.executor, companion.status().pose
        if executor is None or pose is None:
            return
        if self._evidence is None and not executor.evidence.log_odds.any():
            return  # the first picture of the map is whole: not before there is something on it
        if executor.evidence is not self._evidence:
            self._evidence, self._watch, whole = executor.evidence, TileWatch(executor.evidence), True
            self.scene = self._steady.scene(scene_of(self._mission, companion.mission_run, 1))
            self.maps.append((round(time_s, 2), self.scene["map"]))
        if self._watch is None:
            return
        seen = companion.vehicle.scan
        reach_m = 0.0 if seen is None else seen.scan.max_range_m
        if time_s - self._tiles_s < TILES_S - 1e-6 and not whole:
            self._watch.note(executor.evidence, pose.point, reach_m)
            return
        self._tiles_s = time_s
        news = self._watch.changed(executor.evidence, pose.point, reach_m, math.inf if whole else LOOK_S)
        if news:
            self.tiles.append((round(time_s, 2), base64.b64encode(tile_message(news)).decode()))

    def _explained(self, why: Explanation) -> None:
        decision = why.decision
        before, self._reason = self._reason, decision.reason
        goes_on = decision.reason in GOES_ON or decision.reason is before is DecisionReason.GOING_BACK
        self.decisions.append(
            {
                "number": why.number,
                "t": round(why.time_s, 2),
                "target": why.target,
                "action": str(decision.action),
                "part": str(decision.part),
                "reason": str(decision.reason),
                "goes_on": goes_on,
                "lines": explanation_lines(why)[1:],
                "candidates": [_candidate(one, why, self._steady) for one in why.candidates],
            }
        )


def _candidate(candidate: Candidate, why: Explanation, steady: SteadyFrame) -> Json:
    path, decision = candidate.path, why.decision
    taken = path is not None and not candidate.part_of and _ends_like(path.cell_array, decision.path)
    return {
        "name": candidate.name,
        "note": candidate.note,
        "cost": None if not math.isfinite(candidate.cost) else round(candidate.cost, 3),
        "along": None if candidate.curve_cost is None else round(candidate.curve_cost, 3),
        "part": candidate.part_of,
        "taken": taken,
        "cells": []
        if path is None
        else _thinned(steady.places(why.grid.places_of(path.cell_array.astype(np.float64)))),
        "curve": None
        if path is None or path.curve is None
        else _thinned(steady.places(why.grid.places_of(path.curve))),
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
