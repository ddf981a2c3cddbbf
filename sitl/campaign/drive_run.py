"""Drives one run of a campaign, in lock-step."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from companion.app import Status
from companion.core.clock import processor_s
from companion.core.interrupts import is_interrupt
from companion.executive.mission_progress import TargetStatus
from companion.mission.load import load_mission
from companion.mission.mission import GridSpec, HomePoint, Mission, OnBlocked, RoverSpec, SitlSpec, Target
from companion.mission.sensor_tables import is_blind
from companion.recording.recorder import NullRecorder, Recorder
from companion.safety.reasons import EndReason
from companion.settings import Settings
from companion.settings.settings_file import parse_settings
from sitl.campaign.policies import ERROR
from sitl.campaign.run_spec import RunResult, RunSpec
from sitl.campaign.true_ways import Verdicts
from sitl.campaign.wire_watch import WireWatch
from sitl.campaign.worded import BLIND, NOTHING, OWN, GroundSpec, SensorSpec, faults_of
from sitl.experiments.experiment import GUARD
from sitl.experiments.off_model import off_model
from sitl.experiments.person import Person
from sitl.experiments.time_bound import time_bound_s
from sitl.generators.made_ground import MadeGround, NoWayError
from sitl.lockstep import Drive, Report, TrackPoint
from sitl.scenario import Scenario, ScenarioError, scenario_from_mission, with_faults, with_sensors
from sitl.simulator import ROOM_REACH_M
from sitl.world.movers import Mover
from sitl.world.truth import STOOD_M_S, SimStart, Truth

NO_GROUND = "no-ground"
"""The outcome where a kind with these parameters gives no ground with a way."""
USUAL_SENSORS = "lidar-360"
"""On generated ground."""
STREAM = 71
"""Separates what the rover is like from all other random draws with the same seed."""
GROUNDS = 4
"""So many are kept: a run drives on the ground of the run before, or on one from shortly before."""
LOOK_S = 0.5
MOST_OFF = 0.3
"""Nobody knows how a rover brakes that is farther off its model."""
LEAST_S = 1.0
"""Of the time in one metre square that is kept."""


class Nearest:
    """How near the rover has come to anything while it moved, looked at in every tick. Create it before the run.

    Room is worked out only where it may be less than before: it shrinks no faster than rover and things move.
    """

    def __init__(self, run: Drive) -> None:
        self._least_m = ROOM_REACH_M
        self._run, self._before = run, run.simulator.truth
        self._room_m = 0.0
        world, outline = run.simulator.world, run.simulator.outline
        self._turned_m = 0.0 if outline.radius_m else outline.reach_m
        self._moving_m_s = math.inf if world.doors else max((_fastest_m_s(one) for one in world.movers), default=0.0)
        self._heard = run.clock.delivered
        run.clock.delivered = self._look

    @property
    def clearance_m(self) -> float:
        """So far; 0 where it has touched something."""
        touched = any(not hit.was_run_into for hit in self._run.simulator.collisions)
        return 0.0 if touched else self._least_m

    def _look(self, time_s: float, data: bytes) -> None:
        if self._heard is not None:
            self._heard(time_s, data)
        now = self._run.simulator.truth
        if abs(now.speed_m_s) > STOOD_M_S and self._least_room_m(now) < self._least_m:
            self._before, self._room_m = now, self._run.simulator.clearance_m
            self._least_m = min(self._least_m, self._room_m)

    def _least_room_m(self, now: Truth) -> float:
        """It cannot be less, after the way since it was worked out."""
        before = self._before
        turned_rad = abs(math.remainder(now.heading_rad - before.heading_rad, 2.0 * math.pi))
        way_m = math.hypot(now.north_m - before.north_m, now.east_m - before.east_m) + turned_rad * self._turned_m
        return self._room_m - way_m - self._moving_m_s * (now.time_s - before.time_s)


def _fastest_m_s(mover: Mover) -> float:
    steps = np.diff(mover.track, axis=0)
    return float((np.hypot(steps[:, 1], steps[:, 2]) / steps[:, 0]).max())


def drive(spec: RunSpec, folder: Path) -> RunResult:
    """One run. ``folder``: that of the campaign's file. An error of the programs is a result, too."""
    began_s, targets = processor_s(), 0
    try:
        run, verdicts = prepared(spec, folder), Verdicts()
        targets = len(run.mission.targets)
        watch, near = WireWatch(run), Nearest(run)
        _, helped = driven(run, spec, lambda: verdicts.look(run))
        blind_s = watch.blind_s if spec.off_model <= MOST_OFF else 0.0
        ground = _ground_of(spec.world, spec.seed)
        result = _result(run, near, watch.against_pilot, blind_s, verdicts.wrong(run))
        difficulty = None if ground is None else ground.difficulty
        return replace(result, helped=helped, cpu_s=round(processor_s() - began_s, 2), ground=difficulty)
    except NoWayError as error:
        return RunResult("", NO_GROUND, cpu_s=processor_s() - began_s, said=str(error)[:300])
    except Exception as error:
        if is_interrupt(error):
            raise KeyboardInterrupt from None  # within a compiled loop
        text = " ".join(f"{type(error).__name__}: {error}".split())
        return RunResult("", ERROR, targets=targets, cpu_s=processor_s() - began_s, said=text[:300])


def prepared(spec: RunSpec, folder: Path, recorder: Recorder | NullRecorder | None = None) -> Drive:
    """The run, ready to be driven."""
    mission, scenario = _mission_and_scenario(spec, folder)
    settings = settings_of(spec)
    return Drive(
        mission, scenario, settings, spec.seed, recorder or NullRecorder(), spec.time_limit_s, late_s=spec.late_s,
        autopilot_on_s=spec.autopilot_on_s,
    )  # fmt: skip


def driven(run: Drive, spec: RunSpec, look: Callable[[], None] = lambda: None) -> tuple[Report, int]:
    """Drive a prepared run to its end; ``look`` is called every ``LOOK_S``. Returns how often a person helped, too."""
    person = Person()

    def observe(status: Status) -> None:
        look()
        if spec.person:
            person.look(run, status.activity)

    return run.run(observe, LOOK_S), person.helped


def settings_of(spec: RunSpec) -> Settings:
    """The variant's settings, with the run's planner and controller."""
    changes = json.loads(spec.changes)
    changes.setdefault("navigator", {})["planner"] = spec.planner
    changes.setdefault("guidance", {})["controller"] = spec.controller
    return parse_settings(changes, f"settings.{spec.settings}")


def mission_of(spec: RunSpec, folder: Path) -> Mission:
    """The mission that is driven, with the run's sensors."""
    return _mission_on(_ground_of(spec.world, spec.seed), spec, folder)


@lru_cache(maxsize=GROUNDS)
def _ground_of(world: str, seed: int) -> MadeGround | None:
    """None: a mission's file says where it is driven. Kept, for the same ground's next run. Raises NoWayError."""
    ground = GroundSpec.of(world)
    return None if ground is None else ground.made(seed)


def _mission_on(ground: MadeGround | None, spec: RunSpec, folder: Path) -> Mission:
    mission = load_mission(folder / spec.world) if ground is None else _mission_across(ground)
    sensors = SensorSpec.of(spec.sensors).name
    if sensors == OWN:
        return mission
    return with_sensors(mission, str(folder / sensors) if sensors.endswith(".toml") else sensors)


def check_spec(spec: RunSpec, folder: Path) -> None:
    """Raises MissionError, MapError or ScenarioError for a run that cannot be driven at all."""
    mission, _ = _mission_and_scenario(spec, folder)
    if mission.sitl is not None and is_blind(mission.sitl.sensors):
        remedy = "name some there, or in the campaign's list sensors"
        raise ScenarioError(f"{folder / spec.world}: sitl.sensors: there are none: {BLIND}; {remedy}")


def _mission_and_scenario(spec: RunSpec, folder: Path) -> tuple[Mission, Scenario]:
    ground = _ground_of(spec.world, spec.seed)
    mission = _mission_on(ground, spec, folder)
    scenario = scenario_from_mission(mission)
    if ground is not None:
        start = SimStart(*ground.start_m, np.pi / 2.0, scenario.start.home)
        scenario = replace(scenario, world=ground.world, start=start)
    sensors = SensorSpec.of(spec.sensors)
    if sensors.changes.model_fields_set:
        scenario = replace(scenario, sensors=sensors.changed(scenario.sensors))
    if spec.faults != NOTHING:
        scenario = with_faults(scenario, faults_of(spec.faults, folder))
    if spec.guard:
        scenario = replace(scenario, parameters={**scenario.parameters, **GUARD})
    if spec.off_model > 0.0 and mission.rover.turning_radius_m <= 0.0:
        drivetrain, limits = off_model(np.random.default_rng((spec.seed, STREAM)), spec.off_model)
        scenario = replace(scenario, drivetrain=drivetrain, parameters={**scenario.parameters, **limits})
    return mission, scenario


def _mission_across(ground: MadeGround) -> Mission:
    """From one side of generated ground to the other; nothing but the target is given."""
    place = HomePoint(ground.goal_m[0] - ground.start_m[0], ground.goal_m[1] - ground.start_m[1])
    target = Target("goal", place, 0.0, OnBlocked.SKIP)
    sitl = SitlSpec(heading_deg=90.0, sensors=USUAL_SENSORS)
    return Mission(f"{ground.kind}", (target,), GridSpec(margin_m=30.0, by_footprint=True), RoverSpec(), sitl=sitl)


def _result(run: Drive, near: Nearest, against_pilot: int, blind_s: float, called_wrongly: int) -> RunResult:
    report, executor, hits = run.report, run.companion.executor, run.simulator.collisions
    run_into = sum(hit.was_run_into for hit in hits)
    statuses = Counter(status for _, status in report.targets)
    return RunResult(
        led_by="" if executor is None else executor.controller,
        outcome=report.outcome.value,
        reached=statuses[TargetStatus.REACHED],
        targets=len(report.targets),
        touched=len(hits) - run_into,
        run_into=run_into,
        refused=report.refused,
        unreachable=statuses[TargetStatus.UNREACHABLE],
        called_wrongly=called_wrongly,
        left_out=_left_out(run, statuses),
        seconds=round(report.driving_time_s, 2),
        bound_s=0.0 if executor is None else round(time_bound_s(run.mission, run.scenario, executor), 2),
        metres=round(report.distance_m, 2),
        drawn_ah=round(run.simulator.drawn_ah, 4),
        clearance_m=round(near.clearance_m, 3),
        against_pilot=against_pilot,
        blind_s=round(blind_s, 2),
        waits_for=_waits_for(run),
        steps=report.steps,
        searches=report.searches,
        genetic_searches=report.genetic_searches,
        said=report.said[-1][:300] if report.said else "",
        dwelt=_dwelt(report.track),
    )


def _left_out(run: Drive, statuses: Counter[TargetStatus]) -> int:
    """See ``RunResult``. In AUTO the autopilot leads, and may leave a target."""
    end = run.companion.mission_run.end
    if end is None or end.kind is not EndReason.DONE or run.mission.in_auto or run.companion.outcome.broken_off:
        return 0
    return 0 if statuses[TargetStatus.UNREACHABLE] else statuses[TargetStatus.SKIPPED] + statuses[TargetStatus.PENDING]


def _waits_for(run: Drive) -> str:
    """What the companion says that it waits for."""
    awaited = run.companion.status().activity.awaited
    return "" if awaited is None else str(awaited)


def _dwelt(track: list[TrackPoint]) -> tuple[tuple[int, int, float], ...]:
    """See ``RunResult``. From the first movement on: before it the autopilot starts."""
    places = [(one.north_m, one.east_m) for one in track]
    begun = next((number for number, place in enumerate(places) if place != places[0]), 0)
    spent: dict[tuple[int, int], float] = {}
    for one, following in zip(track[begun:], track[begun + 1 :], strict=False):
        square = int(one.north_m // 1.0), int(one.east_m // 1.0)
        spent[square] = spent.get(square, 0.0) + following.time_s - one.time_s
    return tuple((north, east, round(time_s, 1)) for (north, east), time_s in spent.items() if time_s >= LEAST_S)
