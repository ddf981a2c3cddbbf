"""The mission executor: the mission under way, its map, the next target, and the driver that goes there.

Nouns: mission executor, mission task.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace
from enum import Enum, auto
from pathlib import Path

import numpy as np

from companion.control.braking import counted_s, for_link, for_silence, late, soonest_s
from companion.control.controller import ControlCommand, Controller
from companion.control.following import following_of, turns_are_limited, within_limits
from companion.control.local_view import LocalView
from companion.control.model_estimate import ModelEstimator
from companion.core.frames import GeoPoint, NedPoint, Pose
from companion.core.grid import Cell
from companion.core.rover_limits import RoverLimits
from companion.core.scan import RangeScan
from companion.core.severity import Severity, TextSink
from companion.executive.command_progress import START, CommandProgress, CommandResult, names
from companion.executive.command_progress import carried as carried_commands
from companion.executive.command_sender import CommandSender, place_name
from companion.executive.controller_choice import another_controller, settings_in_force
from companion.executive.goal_driver import GoalDriver, controller_for
from companion.executive.laps import LapStart, LapSummary, Odometer, lap_summary
from companion.executive.mission_layout import MissionLayout, apart_m, carried, fenced_again, lay_again, seen_ground
from companion.executive.mission_progress import (
    MissionPhase,
    MissionProgress,
    TargetStatus,
    ended_at,
    ended_early,
    on_reached,
    on_time,
    on_unreachable,
    parked,
    relaid,
    returning,
    sent_to,
    skipped,
    stood_still,
    with_requested,
)
from companion.executive.open_gaps import open_gap_m
from companion.executive.return_path import Refuge, Trail, refuges
from companion.mapping.evidence_map import EvidenceMap, integrate
from companion.mapping.map_edits import forget, look_again, move
from companion.mapping.map_files import save_ros_map
from companion.mission.autopilot_fence import AutopilotFence
from companion.mission.do_commands import DoCommand
from companion.mission.field_size import field_size, finer_gap_m
from companion.mission.mission import Mission
from companion.mission.resolve import ResolvedTarget
from companion.navigation.field_step import Action, Decision
from companion.navigation.search_budget import PathSearcher
from companion.navigation.step_runner import StepRunner
from companion.perception.moving_obstacles import Moving, announced, merged
from companion.perception.object_tracker import ObjectTracker
from companion.perception.range_age import RangeAges
from companion.planning.registry import make_planner
from companion.recording.recorder import RunLog
from companion.safety.reasons import RunPhase
from companion.settings import ControllerKind, Settings
from companion.settings.live_settings import LiveSettings
from companion.vehicle.commands import RunCommand
from companion.vehicle.events import AckSeen
from companion.vehicle.motion_limits import velocity_lasts_s
from companion.vehicle.state import VehicleState

ORIGIN_MOVED_M = 0.2
"""The autopilot tells its origin in whole 1e-7 degrees (1 cm): more than this is another origin."""
VERDICT_S = 15.0
"""After a jump of the position no target is given up for this long: most receivers are right again by then."""
ROLLS_OUT_S = 10.0
"""So long at most a rover is awaited that is to stand."""
ROLLS_BACK_M_S = 0.05
"""Slower than this it may be the noise of the estimate."""
ROLLS_M_S = 0.1
"""However small roll_out_m_s is: slower than this it does not roll."""
WATCHED_SCANS = 20
"""After a wait, obstacles that are not in this many newest scans are forgotten: a door may have opened."""
LAPS_KEPT = 1000
"""The summaries of so many newest laps are kept."""
LAP_M = 1.0
"""A shorter lap has led nowhere: the next one begins after a while."""
MOVED_M = 1.0
"""So much farther than where it counts as arrived, a rover has been moved away from a place."""
STUCK_TOLD = 6
"""People are told each time the rover was stuck so often at one place: every minute or so."""
FAILED = (CommandResult.REFUSED, CommandResult.UNANSWERED)


class MissionTask(Enum):
    """What there is to do for the mission in one tick."""

    STAND = auto()
    """Stand, and make way."""
    DRIVE = auto()
    END = auto()
    """Nothing: the mission has ended."""


class MissionExecutor:
    """Made when the rover may be driven for the first time. It alone writes ``progress``.

    ``scan``: any scan of the rover's sensor. It tells how far and how wide the sensor sees.
    """

    def __init__(
        self,
        mission: Mission,
        settings: LiveSettings,
        layout: MissionLayout,
        progress: MissionProgress,
        scan: RangeScan,
        runner: StepRunner,
        log: RunLog,
        notifier: TextSink,
        rng: np.random.Generator,
    ) -> None:
        self.layout = layout
        self.progress = progress
        self.phase = RunPhase.DRIVING
        self.maps_begun = 0
        """Grows whenever what had been mapped is worth nothing any more, or lies elsewhere."""
        self._mission = mission
        self._settings = settings
        self._counted_for: tuple[int, float, float, float | None] | None = None
        self._counted = settings.current
        """The settings with the link's latency and the guard counted in, and what they were made from."""
        self._runner = runner
        self._log = log
        self._notifier = notifier
        self._scans = 0
        self.trail = Trail()
        """The way back to where the mission began."""
        self._refuges: list[Refuge] = []
        self._unmoved_m = (0.0, 0.0)
        """By how much the map should have been moved farther: it moves by whole cells."""
        self._rolls_until_s: float | None = None
        rover, asked = mission.rover, settings.current.guidance.controller
        self._scan = scan
        given = self._given
        margin_m = given.guidance.narrow_margin_m if scan.is_narrow else 0.0
        self.estimator, self.range_ages = ModelEstimator(following_of(given.motion, {})), RangeAges()
        """How the rover follows velocities."""
        self._limits = RoverLimits(
            rover.radius_m + margin_m,
            rover.cruise_speed_m_s,
            scan.sight_m,
            scan.is_narrow,
            scan.beam_width_rad,
            rover.turning_radius_m,
        )
        if rover.turning_radius_m > 0.0 and scan.is_narrow:
            text = "Single beams see too little for a rover that turns in arcs: give it a lidar"
            notifier.tell(text, Severity.WARNING)
        self.controller: ControllerKind = given.guidance.controller
        """The one in force."""
        if text := another_controller(asked, self.controller, narrow_sight=scan.is_narrow):
            notifier.tell(text, Severity.WARNING)
        searcher = PathSearcher(make_planner(given.navigator.planner, given.planner), rng)
        self.driver = GoalDriver(self._controller(rng), searcher, runner)
        self._tracker = ObjectTracker(layout.evidence)
        self.decisions = 0
        """How many the navigator has made."""
        self.moving: tuple[Moving, ...] = ()
        """What moves round the rover, as of the last tick."""
        self.command_sender = CommandSender(notifier)
        self.odometer = Odometer()
        self.lap_start: LapStart | None = None
        """None before the first tick."""
        self.laps: deque[LapSummary] = deque(maxlen=LAPS_KEPT)
        """The laps of a patrol that have ended."""
        self._now_s = 0.0

    @property
    def evidence(self) -> EvidenceMap:
        """The map."""
        return self.layout.evidence

    @property
    def reached(self) -> int:
        """How many targets have been reached."""
        return sum(status is TargetStatus.REACHED for status in self.progress.statuses)

    @property
    def returning(self) -> bool:
        """Whether the rover is on its way back for good."""
        return bool(self._refuges) or self.progress.ended

    @property
    def target_refused(self) -> str:
        """Why the target that is next must not be driven to; empty when it may, and on the way to any other goal."""
        elsewhere = self.progress.requested is not None or self.progress.phase is not MissionPhase.TRAVEL
        return "" if elsewhere else self.layout.refused.get(self.progress.index, "")

    @property
    def blocked_since_s(self) -> float | None:
        """Since when the present target is waited for, as its way is blocked; None where it is not, or not known."""
        give_up_s = self.progress.give_up_s
        if give_up_s is None or not math.isfinite(give_up_s):
            return None
        return give_up_s - self._settings.current.navigator.wait_limit_s

    def statuses(self) -> list[tuple[str, TargetStatus]]:
        """Every target's name and what has become of it so far."""
        return [(t.name, status) for t, status in zip(self.progress.targets, self.progress.statuses, strict=True)]

    def _controller(self, rng: np.random.Generator) -> Controller:
        """A new one. Only those that draw random numbers take their seed from the run's."""
        seed = 0 if self.controller == "points" else int(rng.integers(2**63))
        return controller_for(self._limits, self._mission.rover.footprint, self.controller, seed)

    # The map and the ground --------------------------------------------------------------------------------------

    def map_scan(self, pose: Pose, yaw_rate_rad_s: float, scan: RangeScan) -> None:
        """Take a scan into the map, unless it is smeared by turning."""
        if abs(yaw_rate_rad_s) <= np.radians(self._settings.current.mapping.max_yaw_rate_deg_s):
            self._scans += 1
            self._tracker.take(pose, yaw_rate_rad_s, scan)
            integrate(self.evidence, pose, scan, self._scans)
            self._tracker.remember(pose, scan.max_range_m)

    def follow_origin(self, origin: GeoPoint, now_s: float) -> bool:
        """Whether the autopilot has moved the origin of its frame; then the mission is laid out anew, the map empty."""
        moved_m = apart_m(origin, self.layout.origin)
        if moved_m <= ORIGIN_MOVED_M:
            return False
        self._notifier.tell(
            f"The autopilot has moved its origin by {moved_m:.1f} m: mission laid out anew", Severity.WARNING
        )
        self.maps_begun += 1
        self.range_ages.begin_anew()
        mapping = self._given.mapping
        self.layout, self.progress = lay_again(
            self.layout, self.progress, self._mission, mapping, origin, narrow_sight=self._scan.is_narrow
        )
        before = self.driver
        # A step of the one before may be drawing from the generator in its thread at this moment: the seed stays.
        searcher, seed = before.searcher, before.seed
        rng = np.random.default_rng((seed, self.maps_begun))
        self.driver = GoalDriver(self._controller(rng), searcher, self._runner, seed)
        self.driver.go_on(before.tally, before.epoch)
        self.driver.give_up_no_target_before(now_s + VERDICT_S)
        self._tracker, self._unmoved_m = ObjectTracker(self.evidence), (0.0, 0.0)
        self.trail, self._refuges = Trail(), self._refuges[-1:]
        self.odometer.forget_place()
        return True

    @property
    def scans_mapped(self) -> int:
        """How many scans were taken into the map since the mission began."""
        return self._scans

    def forget_map(self, now_s: float) -> None:
        """What has been seen lies elsewhere now."""
        forget(self.evidence)
        self.range_ages.begin_anew()
        self.maps_begun += 1
        self._tracker, self._unmoved_m = ObjectTracker(self.evidence), (0.0, 0.0)
        self.driver.leave()
        self.driver.forget_places()
        self.driver.give_up_no_target_before(now_s + VERDICT_S)

    def move_map(self, north_m: float, east_m: float, now_s: float) -> None:
        """The position has stepped, the rover has not: what was seen and driven keeps its place beside the rover.

        What has a place on earth stays: targets, goals that people ask for, rally points, fences, known ground.
        """
        self.range_ages.begin_anew()
        evidence, left = self.evidence, self._unmoved_m
        done_n, done_e = move(evidence, left[0] + north_m, left[1] + east_m)
        self._unmoved_m = left[0] + north_m - done_n, left[1] + east_m - done_e
        self.maps_begun += 1
        start = self.layout.start
        moved = carried(start, north_m, east_m, evidence.base)
        self.layout = replace(self.layout, start=moved)
        self._refuges = [replace(one, place=moved) if one.place == start else one for one in self._refuges]
        if self.progress.home == start:
            self.progress = relaid(self.progress, self.progress.targets, moved, self.progress.requested)
        commands = carried_commands(
            self.progress.commands, lambda point: NedPoint(point.north_m + north_m, point.east_m + east_m)
        )
        self.progress = replace(self.progress, commands=commands)
        self.trail = self.trail.carried(north_m, east_m, evidence.base)
        self._tracker = ObjectTracker(evidence)
        self.driver.leave()
        self.driver.forget_places()
        self.driver.give_up_no_target_before(now_s + VERDICT_S)

    def heed_fence(self, fence: AutopilotFence) -> None:
        """The autopilot's fence as it is now; a new one closes and opens ground at once."""
        if fence == self.layout.fence:
            return
        self.layout = fenced_again(self.layout, self._mission, fence)
        self.driver.leave()
        text = f"The autopilot's fence has changed: {len(self.layout.bounds)} borders now"
        self._notifier.tell(text, Severity.WARNING)

    def save_map(self, path_without_suffix: Path) -> None:
        """Write what has been mapped as a ROS map (.yaml and .pgm), its place in metres from home. Raises MapError."""
        ground, known = seen_ground(self.layout)
        save_ros_map(ground, path_without_suffix, known=known)

    # Other goals than the next target ----------------------------------------------------------------------------

    def request(self, goal: ResolvedTarget) -> None:
        """Drive to a goal that a person asks for first; then the mission goes on."""
        self._advance(with_requested(self.progress, goal))
        self.driver.leave()

    def skip(self) -> None:
        """Leave the present goal out."""
        self._advance(skipped(self.progress))
        self.driver.leave()

    def end_early(self) -> None:
        """End the mission here, as for a patrol that nothing else ends."""
        self._advance(ended_early(self.progress))
        self.driver.leave()

    def park(self) -> None:
        """Nowhere to go until a leg is handed over; the end when every target has had its turn."""
        self.progress = parked(self.progress)

    def drive_leg(self, index: int) -> None:
        """AUTO hands over the leg to this target."""
        self.progress = sent_to(self.progress, index)
        self.driver.leave()

    def end_leg(self, status: TargetStatus) -> None:
        """AUTO has ended the leg to the present target; ``status`` is what has become of that."""
        self.progress = ended_at(self.progress, status)

    def go_back(self, reason: str, rally: list[NedPoint], pose: Pose) -> None:
        """Give the mission up: to the nearest rally point, or back the way the rover came. ``reason`` is told."""
        planner = make_planner("dijkstra", self._settings.current.planner)
        # The rover may have entered a field since the last tick.
        self.trail.enter(self.evidence.base.cell_at(pose.point), pose.point)
        self._refuges = refuges(self.progress.home, self.trail, rally, pose.point, self.evidence, planner)
        missed = [name for name, status in self.statuses() if status is not TargetStatus.REACHED]
        text = f"Returning: {reason}. Missed: {', '.join(missed) or 'nothing'}"
        self._notifier.tell(text, Severity.WARNING)
        self._seek_refuge()

    def _seek_refuge(self) -> None:
        """The next place to try."""
        refuge = self._refuges[0]
        self._rolls_until_s = None
        self._advance(returning(self.progress, refuge.place))
        along = " along the way it came" if refuge.way else ""
        self._notifier.tell(f"Back to {refuge.place.name}, {refuge.length_m:.0f} m{along}", Severity.WARNING)

    # Commands of the mission, and laps ----------------------------------------------------------------------------

    def commands_due(self, vehicle: VehicleState, now_s: float) -> RunCommand | None:
        """The command to send in this tick, if there is one. Asked only while the rover is driven."""
        pose, head = vehicle.pose_at(now_s), self.progress.commands.head
        if pose is None:
            return None
        left_m = math.inf if self.progress.ended else pose.point.distance_m(self.progress.goal.point)
        near_m = self._given.guidance.arrival_m + MOVED_M
        commands, command = self.command_sender.due(
            self.progress.commands,
            now_s,
            left_m,
            vehicle.latency_s,
            self._commands_place,
            away=head is not None and head.is_left_by(pose.point, near_m),
        )
        self._set_commands(commands)
        return command

    def answered(self, ack: AckSeen) -> None:
        """An answer of the autopilot to any command."""
        self._set_commands(self.command_sender.answered(self.progress.commands, ack, self._commands_place))

    def resume_commands(self) -> None:
        """Take up the commands that an earlier run has left open."""
        self._set_commands(self.command_sender.resume(self.progress.commands, self._commands_place))

    def _set_commands(self, commands: CommandProgress) -> None:
        """How far the commands are: mostly as before."""
        if commands is not self.progress.commands:
            self.progress = replace(self.progress, commands=commands)

    @property
    def _commands_place(self) -> str:
        return place_name(self.progress.commands.head, tuple(target.name for target in self.progress.targets))

    @property
    def _busy_here(self) -> bool:
        """Whether the rover stays for a command; not on its way back, where nothing may hold it up."""
        return self.progress.commands.keeps_here and self.progress.phase is not MissionPhase.HOME

    def _reach_here(self, at: NedPoint, now_s: float) -> None:
        """A target without a place of its own is reached where the rover is."""
        self._notifier.tell(f"Reached {self.progress.goal.name}, where the rover is", Severity.INFO)
        self._advance(on_reached(self.progress, now_s, at), now_s)
        self.driver.leave()

    def _note_way(self, pose: Pose, now_s: float) -> None:
        self.odometer.at(pose.point)
        if self.lap_start is None:
            self.lap_start = LapStart(now_s)
        self._now_s = now_s

    def _advance(self, progress: MissionProgress, now_s: float | None = None) -> None:
        """The mission's progress from here on. Commands that were left out, and a lap that has ended, are told."""
        before, self.progress = self.progress, progress
        now_s = self._now_s if now_s is None else now_s
        if progress.lap > before.lap:
            self._end_lap(before.lap, now_s)
        if progress.commands.total(CommandResult.LEFT_OUT) > before.commands.total(CommandResult.LEFT_OUT):
            self._tell_left_out(before, progress)

    def _tell_left_out(self, before: MissionProgress, after: MissionProgress) -> None:
        counts = {(t.place, t.number): t.count(CommandResult.LEFT_OUT) for t in before.commands.tallies}
        left = [
            self.command_at(t.place, t.number)
            for t in after.commands.tallies
            if t.count(CommandResult.LEFT_OUT) > counts.get((t.place, t.number), 0)
        ]
        self._notifier.tell(f"Not sent, the rover is not there: {names(left)}", Severity.WARNING)

    def command_at(self, place: int, number: int) -> DoCommand:
        """The command of this number at a place."""
        commands = self._mission.commands if place == START else self._mission.targets[place].commands
        return commands[number]

    def _end_lap(self, number: int, now_s: float) -> None:
        progress, start = self.progress, self.lap_start or LapStart(now_s)
        first = 0 if progress.patrol is None else progress.patrol.first
        missed = [
            target.name
            for target, status in zip(progress.targets[first:], progress.last_lap, strict=True)
            if status is not TargetStatus.REACHED
        ]
        failed = progress.commands.total(*FAILED)
        lap = lap_summary(number, start, now_s, self.odometer.driven_m, missed, failed)
        self.lap_start = LapStart(now_s, self.odometer.driven_m, failed)
        self.laps.append(lap)
        self._notifier.tell(str(lap), Severity.INFO)
        if lap.driven_m < LAP_M:
            self.progress = stood_still(progress, now_s, self._settings.current.navigator.wait_retry_s)

    # One tick ----------------------------------------------------------------------------------------------------

    def decide(self, vehicle: VehicleState, now_s: float) -> MissionTask:
        """What to do for the mission now, and by which path: legs begin and end here, and the navigator decides."""
        view = self.view(vehicle, now_s)
        self.moving = self._moving(vehicle, view)
        self.trail.enter(self.evidence.base.cell_at(view.pose.point), view.pose.point)
        self._note_way(view.pose, now_s)
        waited = self.progress.phase is MissionPhase.WAIT
        self._advance(on_time(self.progress, now_s), now_s)
        if waited and self.progress.phase is MissionPhase.TRAVEL:
            look_again(self.evidence, self._scans - WATCHED_SCANS)
        if self.progress.ended:
            return MissionTask.END
        if self.progress.goal.here and self.progress.phase is MissionPhase.TRAVEL and not self._busy_here:
            self._reach_here(view.pose.point, now_s)
        if self.progress.phase in (MissionPhase.STAY, MissionPhase.WAIT) or self._busy_here:
            waits = self.progress.phase is MissionPhase.WAIT
            self.phase = RunPhase.WAY_BLOCKED if waits else RunPhase.STAYING
            self.driver.pause()
            return MissionTask.STAND
        if self.driver.goal != self.progress.goal:
            if self._is_refused(now_s) or self._rolls_on(view):
                return MissionTask.STAND
            self._notifier.tell(f"Heading for {self.progress.goal.name}", Severity.INFO)
            way = self._way_back(view.pose)
            driven = self.trail.driven(self.evidence) if way else frozenset()
            self.driver.head_for(self.progress.goal, view, way, driven)
        self._rolls_until_s = None
        self.phase = RunPhase.DRIVING
        decision = self.driver.decide(view, self.moving)
        if decision is not None:
            self._take_decision(decision, view.pose.point, now_s)
        return MissionTask.DRIVE

    def guide(self, task: MissionTask, view: LocalView) -> ControlCommand:
        """How to do now what was decided: the setpoint and the speed."""
        if task is MissionTask.STAND:
            return self.driver.standing(view, self.moving)
        before, command = self.driver.stuck_here, self.driver.guide(view, self.moving)
        times = self.driver.stuck_here
        if times != before and times % STUCK_TOLD == 0:
            text = f"Stuck {times} times at one place, heading for {self.progress.goal.name}: goes on looking for a way"
            self._notifier.tell(text, Severity.WARNING)
        return command

    def learn(self, view: LocalView) -> None:
        """One more moment that may tell how the rover follows velocities. ``view`` knows what was told lately."""
        if self.learns:
            self.estimator.note(view)

    @property
    def learns(self) -> bool:
        """Whether it matters how the rover follows velocities, and is estimated."""
        return self.controller != "points" and self._settings.current.motion.learns

    def view(self, vehicle: VehicleState, now_s: float) -> LocalView:
        """This moment. Settings that were changed count from here on; those of the map itself and the planner stay."""
        pose = vehicle.pose_at(now_s)
        assert pose is not None
        settings = self._settings_in_force(vehicle, now_s)
        rate_rad_s = 0.0 if vehicle.attitude is None else vehicle.attitude.yaw_rate_rad_s
        back = vehicle.forward_m_s < -ROLLS_BACK_M_S
        motion = settings.motion
        limited = turns_are_limited(motion, vehicle.parameters)
        self.estimator.assume(following_of(motion, vehicle.parameters), limited=limited)
        found = self.estimator.estimate.following(motion.off_model_known)
        follows = late(found, motion.dead_s, vehicle.latency_s)
        rover = self._limits if self.controller == "points" else within_limits(self._limits, vehicle.parameters)
        return LocalView(
            pose, vehicle.speed_m_s, self.evidence, rover, settings, rate_rad_s, rolls_back=back,
            following=follows, soonest_s=soonest_s(found, vehicle.latency_s),
            body=self._mission.rover.footprint, scans=self._scans,
        )  # fmt: skip

    def _moving(self, vehicle: VehicleState, view: LocalView) -> tuple[Moving, ...]:
        """All that moves round the rover, announced or seen."""
        now_s = view.pose.time_s
        others = announced(vehicle, view.pose, self._mission.rover.radius_m, self._settings.current.traffic)
        return merged(others, self._tracker.moving(now_s, view.settings.traffic), now_s)

    @property
    def _given(self) -> Settings:
        """The settings as they are now, of the controller in force."""
        return settings_in_force(self._settings.current, self._scan, self._mission.rover.turning_radius_m)

    def _settings_in_force(self, vehicle: VehicleState, now_s: float) -> Settings:
        """The settings for the link as late as it is, for the guard that is there, and the autopilot's own timeout."""
        guard, link_s = vehicle.guard_at(now_s), vehicle.latency_s
        waits_s = None if guard is None else guard.waits_s
        told_s = velocity_lasts_s(vehicle.parameters, self._settings.current.guidance.velocity_lasts_s)
        made_from = (self._settings.changes, counted_s(link_s), told_s, waits_s)
        if made_from != self._counted_for:
            self._counted_for = made_from
            self._counted = for_silence(for_link(self._given, link_s), told_s, waits_s)
        return self._counted

    def _is_refused(self, now_s: float) -> bool:
        """Whether the next target lies behind the autopilot's fence: then it is not tried, and the next one comes."""
        reason = self.target_refused
        if not reason:
            return False
        self._notifier.tell(f"Refused: {reason}", Severity.WARNING)
        navigator = self._settings.current.navigator
        self._advance(on_unreachable(self.progress, now_s, navigator.wait_retry_s, navigator.wait_limit_s), now_s)
        return True

    def _rolls_on(self, view: LocalView) -> bool:
        """Whether the rover leaves the place where its way back begins: that is laid from where it comes to stand.

        No longer than ``ROLLS_OUT_S``: a speed that never becomes zero must not keep it here.
        """
        refuge = self._refuges[0] if self._refuges else None
        if refuge is None or not refuge.way or self.progress.goal != refuge.place:
            return False
        if self._rolls_until_s is None:
            self._rolls_until_s = view.pose.time_s + ROLLS_OUT_S
        rolls = view.speed_m_s > max(view.settings.guidance.roll_out_m_s, ROLLS_M_S)
        return rolls and view.pose.time_s < self._rolls_until_s

    def _way_back(self, pose: Pose) -> tuple[Cell, ...]:
        """The fields to follow to a refuge, where they are known and the rover has not left that way."""
        if not self._refuges or not self._refuges[0].way:
            return ()
        way, here = self.trail.back(), self.evidence.base.cell_at(pose.point)
        return way if way[0] == here and way[-1] == self._refuges[0].place.cell else ()

    def _tell_of_gaps(self) -> None:
        """Which gaps count as closed, and what would open more, where something would."""
        rover, evidence, grid = self._mission.rover, self.evidence, self._mission.grid
        settings, side_m = evidence.settings, evidence.base.resolution_m
        size = field_size(rover, settings, narrow_sight=self._scan.is_narrow)
        gap_m = open_gap_m(rover, evidence)
        if size.may_be_finer(side_m):
            fine_m = finer_gap_m(rover, settings, size.fine_m)
            # Evidence for planned motions is finest where fields follow from the rover.
            how = "" if settings.keeps == "circle" or grid.by_footprint else " (leave out grid.resolution_m)"
            text = (
                f"Map fields of {side_m:.3g} m may close gaps below {gap_m:.1f} m; smaller ones{how} open more, "
                f"of {size.fine_m:.2g} m down to {fine_m:.1f} m"
            )
        else:
            text = f"Gaps below {gap_m:.1f} m may count as closed"
            if self._scan.is_narrow:
                text += ": single beams need wide ones, a lidar sees more"
            elif rover.turning_radius_m > 0.0:
                text += ": arcs need wide ones"
        self._notifier.tell(text, Severity.INFO)

    def _give_up(self, what: str, now_s: float) -> None:
        """There is no way to the goal. ``what``: its name, and why."""
        navigator = self._settings.current.navigator
        # How long a leg of AUTO may take is the autopilot's to say (DO_GUIDED_LIMITS).
        limit_s = math.inf if self._mission.in_auto else navigator.wait_limit_s
        after = on_unreachable(self.progress, now_s, navigator.wait_retry_s, limit_s)
        waits = after.phase is MissionPhase.WAIT and after.tries_again
        text = f"No way now: {what}; tries again in {navigator.wait_retry_s:g} s" if waits else f"Unreachable: {what}"
        self._notifier.tell(text, Severity.WARNING)
        self._tell_of_gaps()
        if len(self._refuges) > 1:
            self._refuges.pop(0)
            self._seek_refuge()
        else:
            self._advance(after, now_s)

    def _take_decision(self, decision: Decision, at: NedPoint, now_s: float) -> None:
        goal = self.progress.goal
        self.decisions += 1
        self._log.write_decision(now_s, goal.name, decision)
        if decision.action is Action.REACHED:
            self._notifier.tell(f"Reached {goal.name}", Severity.INFO)
            self._advance(on_reached(self.progress, now_s, at), now_s)
        elif decision.action is Action.UNREACHABLE:
            self._give_up(f"{goal.name} ({decision.reason})", now_s)
        if decision.action in (Action.REACHED, Action.UNREACHABLE):
            self.driver.leave()
