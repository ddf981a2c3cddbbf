"""The companion: what it does in one tick of its loop, 20 times a second.

Nouns: companion, tick.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from companion.checkpoint.checkpointer import Checkpointer
from companion.control.model_estimate import ModelEstimate
from companion.core.clock import Clock
from companion.core.frames import GeoPoint
from companion.executive.command_progress import CommandProgress
from companion.executive.command_report import command_lines, commands_done
from companion.executive.goal_driver import GoalDriver
from companion.executive.laps import LapSummary
from companion.executive.mission_executor import MissionExecutor
from companion.executive.mission_progress import MissionProgress, TargetStatus
from companion.lidar.reader import Lidars
from companion.mapping.evidence_map import EvidenceMap
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mission.mission import Mission
from companion.navigation.step_runner import StepRunner
from companion.operator.notifications import News, Outcome, Status, status_of
from companion.recording.recorder import RunLog
from companion.safety.reasons import EndReason, Parting, Reason
from companion.settings import Settings
from companion.supervision.assembly import Options, assemble
from companion.vehicle.state import VehicleState

__all__ = ["Companion", "Outcome", "Status"]


class Companion:
    """Reads the vehicle, keeps the map, decides, and commands, tick by tick.

    It owns no socket and no clock: both are handed in, so that the same companion runs in real time and in lock-step.
    """

    def __init__(
        self,
        autopilot: AutopilotLink,
        clock: Clock,
        mission: Mission,
        settings: Settings,
        runner: StepRunner,
        log: RunLog,
        *,
        seed: int,
        arm: bool,
        checkpointer: Checkpointer | None = None,
        keep_settings: Callable[[Settings], None] | None = None,
        lidars: Lidars | None = None,
    ) -> None:
        """``lidars``: those that are wired to the companion itself."""
        options = Options(seed, arm, checkpointer, keep_settings, lidars or Lidars())
        made = assemble(autopilot, clock, mission, settings, runner, log, options)
        self._autopilot = autopilot
        self._clock = clock
        self._pace = made.pace
        self._dispatcher = made.dispatcher
        self._operator_server = made.operator_server
        self._supervisor = made.supervisor
        self._notifier = made.notifier
        self._ticked_s = clock.now_s()
        self.mission_run = made.run
        self.outcome = made.outcome

    def tick(self) -> None:
        """One tick: sleep, listen, map, answer, supervise, decide, guide, speak, conclude."""
        now_s = self._ticked_s = self._pace.sleep()
        scans = self._dispatcher.listen(now_s)
        self.mission_run.map(scans)
        self._operator_server.answer(now_s)
        verdict = self._supervisor.supervise(now_s)
        task = self.mission_run.decide(verdict, now_s)
        command = self.mission_run.guide(task, now_s)
        self.mission_run.speak(command, now_s)
        self._supervisor.conclude(task, now_s)
        self._autopilot.service(now_s)
        self.outcome.tick_seconds.append(self._pace.elapsed_s)

    def run(self, observe: Callable[[Status], None] = lambda status: None) -> Outcome:
        """Tick until the mission has ended."""
        while not self.done:
            self.tick()
            observe(self.status())
        return self.outcome

    def stop(self, why: EndReason = EndReason.STOPPED_BY_USER) -> None:
        """Ask for an orderly end at the next tick: the rover is stopped and put into HOLD. Safe in a signal handler."""
        self._supervisor.stop(why)

    def close(self) -> None:
        """The way out after an error: a rover that is ours is stopped and put into HOLD before this returns."""
        self._supervisor.close(self._clock)

    @property
    def done(self) -> bool:
        """Whether the mission has ended, one way or another."""
        return self._supervisor.done

    @property
    def parting(self) -> Reason[Parting] | None:
        """How the rover is left, as of the last tick; None where nobody must know."""
        return self._supervisor.parting(self._ticked_s)

    def statuses(self) -> list[tuple[str, TargetStatus]]:
        """Every target's name and what has become of it so far."""
        return self.mission_run.statuses()

    def command_lines(self) -> list[str]:
        """A line for each command of the mission: what has become of it so far."""
        return command_lines(self.mission_run.mission, self._commands)

    def commands_done(self) -> str:
        """How many of the mission's commands had which result; empty for a mission without commands."""
        return commands_done(self.mission_run.mission, self._commands)

    @property
    def _commands(self) -> CommandProgress | None:
        return None if self.executor is None else self.executor.progress.commands

    @property
    def laps(self) -> tuple[LapSummary, ...]:
        """The newest laps of a patrol that have ended."""
        return () if self.executor is None else tuple(self.executor.laps)

    @property
    def complete(self) -> bool:
        """Whether every target has been reached, in every lap."""
        missed = 0 if self.executor is None else self.executor.progress.missed
        return not missed and all(status is TargetStatus.REACHED for _, status in self.statuses())

    @property
    def estimate(self) -> ModelEstimate | None:
        """How the rover follows velocities; None where motions are not planned, or before the mission has begun."""
        executor = self.mission_run.executor
        return executor.estimator.estimate if executor is not None and executor.learns else None

    @property
    def full_throttle_m_s(self) -> float | None:
        """How fast the rover goes with its throttle fully open; None before enough was seen."""
        return self.mission_run.full_throttle.m_s

    @property
    def news(self) -> tuple[News, ...]:
        """What was said in this tick, by the autopilot as well."""
        return tuple(self._notifier.news)

    def status(self) -> Status:
        """A picture of this moment."""
        return status_of(self.mission_run, self._notifier, self._clock.now_s())

    def save_map(self, path_without_suffix: Path) -> bool:
        """Write what has been mapped as a ROS map (.yaml and .pgm), its place in metres from home.

        False when the mission has not begun. Raises MapError when it cannot be written.
        """
        if self.executor is None:
            return False
        self.executor.save_map(path_without_suffix)
        return True

    # What others look at; None before the mission has begun --------------------------------------------------------

    @property
    def vehicle(self) -> VehicleState:
        """The newest of everything that was heard."""
        return self.mission_run.vehicle

    @property
    def executor(self) -> MissionExecutor | None:
        """The mission under way."""
        return self.mission_run.executor

    @property
    def evidence(self) -> EvidenceMap | None:
        """The map."""
        return None if self.executor is None else self.executor.evidence

    @property
    def driver(self) -> GoalDriver | None:
        """What drives to the present goal."""
        return None if self.executor is None else self.executor.driver

    @property
    def progress(self) -> MissionProgress | None:
        """Progress through the targets."""
        return None if self.executor is None else self.executor.progress

    @property
    def origin(self) -> GeoPoint | None:
        """The place that map and targets count from, in metres."""
        return None if self.executor is None else self.executor.layout.origin
