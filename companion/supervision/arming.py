"""Arming: from a link to a rover that may be driven; what is awaited, and the one command that would help.

Nouns: arming.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from companion.checkpoint.resume import PreviousRun, ResumePermission, resume_permission, resumed_layout, same_boot
from companion.control.controller import STANDSTILL
from companion.core.severity import Severity
from companion.executive.command_sender import result_text
from companion.executive.controller_choice import settings_in_force
from companion.executive.mission_layout import MissionLayout, lay
from companion.executive.mission_progress import MissionProgress, plan_progress
from companion.executive.mission_run import MissionRun
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mission.bounds import Bounds
from companion.mission.doubtful_places import doubtful_places
from companion.mission.mission import MissionError
from companion.operator.notifications import Notifier
from companion.safety.mode_latch import Control
from companion.safety.reasons import Doubt, PowerReason, Reason, WaitReason
from companion.safety.watchdogs import data_doubt
from companion.settings import SafetySettings
from companion.settings.live_settings import LiveSettings
from companion.supervision.mission_limits import MissionLimits
from companion.vehicle.commands import Arm, Command, SetMode
from companion.vehicle.events import AckSeen, HeartbeatSeen, RoverMode
from companion.vehicle.state import VehicleState

ASK_AGAIN_S = 3.0
"""At least this long lies between two commands; one that has not worked is repeated after it."""
AGAIN_RESUMED_S = 1.0
"""A resumed run repeats a command after this long: it should go on as soon as the autopilot can be armed."""
TAKEN_S = 0.5
"""A heartbeat this long after the autopilot accepted a mode shows the mode that it is really in."""
LEFT_S = 10.0
"""For a rover that an earlier run left armed in GUIDED: if it cannot be driven for this long, it is put into HOLD."""
LOOK_AGAIN_S = 2.0
"""A rover outside the mission's grid is checked again after this long."""


@dataclass(frozen=True, slots=True)
class ArmingStep:
    """``awaited`` is None when the rover may be driven; ``command`` would help to bring what is awaited."""

    awaited: Reason[WaitReason] | None = None
    command: Command | None = None


@dataclass(frozen=True, eq=False, slots=True)
class Cleared:
    """The rover may be driven: the mission on the ground, how far it has come, and what to say of a map taken up."""

    layout: MissionLayout
    progress: MissionProgress
    found: str = ""


def arming_step(
    vehicle: VehicleState,
    now_s: float,
    settings: SafetySettings,
    *,
    arm: bool,
    control: Control = Control.NOBODY,
    hindrance: Reason[WaitReason] | None = None,
    listens: str = "",
) -> ArmingStep:
    """What stands between now and driving. ``hindrance``: anything else that keeps GUIDED from being set.

    GUIDED is set only on a rover that nobody drives (disarmed, or in HOLD), and never on one that a person has had
    (``control``); arming only if told to (``arm``). ``listens``: where the autopilot is listened for, in words.
    """
    heartbeat = vehicle.heartbeat
    if heartbeat is None:
        return ArmingStep(Reason(WaitReason.HEARTBEAT, (listens,)))
    if vehicle.origin is None or vehicle.home is None:
        return ArmingStep(Reason(WaitReason.ORIGIN_AND_HOME))
    if (doubt := data_doubt(vehicle, now_s, settings)) is not None:
        return ArmingStep(Reason(WaitReason.GOOD_DATA, (doubt,)))
    if hindrance is not None:
        return ArmingStep(hindrance)
    if vehicle.in_auto:
        ready = heartbeat.mode == RoverMode.AUTO and heartbeat.armed
        return ArmingStep(None if ready else Reason(WaitReason.PERSON_STARTS_AUTO))
    if heartbeat.mode != RoverMode.GUIDED:
        if heartbeat.armed and heartbeat.mode != RoverMode.HOLD:
            return ArmingStep(Reason(WaitReason.PERSON_SETS_GUIDED))
        if control is Control.PERSON:
            return ArmingStep(Reason(WaitReason.PERSON_SETS_GUIDED_AGAIN))
        return ArmingStep(Reason(WaitReason.GUIDED), SetMode(RoverMode.GUIDED))
    if heartbeat.armed:
        return ArmingStep()
    return ArmingStep(Reason(WaitReason.ARMING), Arm()) if arm else ArmingStep(Reason(WaitReason.PERSON_ARMS))


def overruled(ack: AckSeen | None, heartbeat: HeartbeatSeen | None) -> bool:
    """Whether a person has chosen another mode since the autopilot took ours, with no heartbeat in GUIDED between."""
    if ack is None or ack.result != 0 or heartbeat is None:
        return False
    return heartbeat.mode != RoverMode.GUIDED and heartbeat.time_s - ack.time_s > TAKEN_S


class Arming:
    """The way there, tick by tick. ``previous``: the run that is to be taken up."""

    def __init__(
        self,
        run: MissionRun,
        autopilot: AutopilotLink,
        limits: MissionLimits,
        settings: LiveSettings,
        notifier: Notifier,
        *,
        arm: bool,
        previous: PreviousRun | None = None,
    ) -> None:
        self._run = run
        self._autopilot = autopilot
        self._limits = limits
        self._settings = settings
        self._notifier = notifier
        self._previous = previous
        self._arm = arm
        self._awaited: Reason[WaitReason] | None = None
        self._owner: ResumePermission | None = None
        self._asked: Command | None = None
        self._asked_s = -math.inf
        self._mode: int | None = None
        self._persons = False
        self._left_since_s = math.inf
        self._look_again_s = -math.inf
        self._checked: tuple[object, ...] = ()
        self._bounds: Bounds | None = None

    def step(self, now_s: float) -> Cleared | None:
        """The mission on the ground once the rover may be driven; until then all is done that brings it there.

        Raises MissionError as soon as it is known that the mission cannot be laid out, or (unless it is taken up) has a
        target behind a fence, before anybody arms.
        """
        if self._autopilot.twin_heard(now_s):
            self._run.awaited = Reason(WaitReason.OTHER_COMPANION_SILENT)
            return None
        cleared = None if now_s < self._look_again_s else self._look(self._run.vehicle, now_s)
        if cleared is None:
            self._tell_what_is_awaited()
        return cleared

    def must_end(self, now_s: float) -> Reason[PowerReason] | None:
        """Why a rover that an earlier run left driving must stop for good where it is."""
        if self._autopilot.twin_heard(now_s) or not self._left_driving():
            return None
        return self._limits.must_stop(now_s)

    def _left_driving(self) -> bool:
        """Whether the rover is where an earlier run has left it, armed in GUIDED: nobody else may be there.

        While AUTO is served, GUIDED is a person's.
        """
        vehicle, heartbeat = self._run.vehicle, self._run.vehicle.heartbeat
        ours = self._previous is not None and self._previous.state.control is Control.COMPANION and not vehicle.in_auto
        return ours and heartbeat is not None and heartbeat.mode == RoverMode.GUIDED and heartbeat.armed

    def _look(self, vehicle: VehicleState, now_s: float) -> Cleared | None:
        self._check(vehicle, now_s)
        hindrance = self._limits.awaited(now_s, left_driving=self._left_driving()) or self._too_near(vehicle, now_s)
        hindrance = Reason(WaitReason.REQUEST_TO_BEGIN) if self._run.start_paused else hindrance
        control = Control.PERSON if self._had_by_person(vehicle) else self._whose(vehicle)
        if hindrance is None and control is Control.PERSON and self._awaits_guard(vehicle):
            hindrance = Reason(WaitReason.GUARD_TELLS)
        # A person who disarms the rover does not want it armed again by itself.
        self._arm = self._arm and not (vehicle.heartbeat is not None and vehicle.heartbeat.armed)
        settings, listens = self._settings.current.safety, self._autopilot.trouble
        step = arming_step(
            vehicle, now_s, settings, arm=self._arm, control=control, hindrance=hindrance, listens=listens
        )
        self._awaited = step.awaited
        if step.awaited is not None:
            self._give(step.command or self._standstill(vehicle, now_s), now_s)
            return None
        cleared = self._lay(vehicle, now_s)
        if cleared is not None and self._stands_on(cleared.layout, vehicle, now_s):
            return cleared
        self._awaited = Reason(WaitReason.ON_THE_GRID)
        self._look_again_s = now_s + LOOK_AGAIN_S
        self._send(self._standstill(vehicle, now_s), now_s)
        return None

    # Commands ----------------------------------------------------------------------------------------------------

    def _standstill(self, vehicle: VehicleState, now_s: float) -> Command | None:
        """For a rover that an earlier run left driving: it stops until its ground is known; HOLD if that takes long."""
        if not self._left_driving():
            self._left_since_s = math.inf
            return None
        self._left_since_s = min(self._left_since_s, now_s)
        if now_s - self._left_since_s < LEFT_S and not vehicle.sticks.moved:
            return STANDSTILL.setpoint
        self._owner = ResumePermission(Control.PERSON, may_arm=False)
        return SetMode(RoverMode.HOLD)

    def _give(self, command: Command | None, now_s: float) -> None:
        """Send the command, unless it is too soon. A resumed run waits only before it repeats the same command."""
        if self._previous is None:
            soon = now_s - self._asked_s <= ASK_AGAIN_S
        else:
            soon = command == self._asked and now_s - self._asked_s <= AGAIN_RESUMED_S
        if command is None or soon:
            return
        self._asked, self._asked_s = command, now_s
        self._send(command, now_s)

    def _send(self, command: Command | None, now_s: float) -> None:
        if command is None:
            return
        self._run.sender.send(command, now_s)
        if command == SetMode(RoverMode.HOLD):
            moved = self._run.vehicle.sticks.moved
            why = Reason(Doubt.STICKS_MOVED) if moved else Reason(Doubt.WAITED_TOO_LONG, (self._awaited,))
            self._notifier.tell(f"HOLD: {why}", Severity.WARNING)

    def _tell_what_is_awaited(self) -> None:
        refused = self._autopilot.last_ack(Arm())
        arming = self._awaited is not None and self._awaited.kind is WaitReason.ARMING
        if refused is not None and refused.result != 0 and arming:
            self._notifier.once(f"The autopilot refuses to arm ({result_text(refused.result)}): its own texts say why")
        self._run.awaited = self._awaited

    # Whose rover it is -------------------------------------------------------------------------------------------

    def _had_by_person(self, vehicle: VehicleState) -> bool:
        """Whether a person drove it or took it out of our mode during this run, and has not set our mode since."""
        if (heartbeat := vehicle.heartbeat) is None:
            return False
        if heartbeat.mode == vehicle.own_mode:
            self._persons = False
        elif self._mode == vehicle.own_mode or (heartbeat.armed and heartbeat.mode != RoverMode.HOLD):
            self._persons = True
        self._mode = heartbeat.mode
        return self._persons

    def _whose(self, vehicle: VehicleState) -> Control:
        """Who drives. If an earlier run had the rover, its saved state decides first; then the mode does, as always."""
        taken = overruled(self._autopilot.last_ack(SetMode(RoverMode.GUIDED)), vehicle.heartbeat)
        control = Control.PERSON if taken else self._run.latch.control
        if self._owner is None and self._previous is not None:
            self._owner = resume_permission(self._previous.state, vehicle)
            self._arm = self._arm and (self._owner is None or self._owner.may_arm)
        if control is not Control.NOBODY or self._previous is None:
            return control
        return Control.PERSON if self._owner is None else self._owner.control

    def _awaits_guard(self, vehicle: VehicleState) -> bool:
        """Whether an earlier run had the rover, and the guard has not yet told who put it into HOLD."""
        previous = self._previous
        known = vehicle.heartbeat is not None and vehicle.position is not None
        return previous is not None and previous.state.guarded and self._owner is None and known and not self._persons

    # The mission on the ground -----------------------------------------------------------------------------------

    def _check(self, vehicle: VehicleState, now_s: float) -> None:
        """Lay the mission out to see whether it can be: once, and again when origin, home or fence are others."""
        ground = (vehicle.origin and vehicle.origin.point, vehicle.home and vehicle.home.point, self._limits.fence)
        if ground == self._checked:
            return
        cleared = self._lay(vehicle, now_s)
        if cleared is None:
            return
        # A run that is taken up may find that a fence has closed meanwhile: its target is refused when its turn comes.
        if self._previous is None and cleared.layout.refused:
            mission, reason = self._run.mission, next(iter(cleared.layout.refused.values()))
            raise MissionError(f"{mission.source or mission.name}: {reason}")
        self._checked, self._bounds, self._run.laid = ground, cleared.layout.bounds, cleared.layout.places
        for line in doubtful_places(self._run.mission, cleared.layout.home):
            self._notifier.tell(f"Warning: {line}", Severity.WARNING)

    def _too_near(self, vehicle: VehicleState, now_s: float) -> Reason[WaitReason] | None:
        pose = vehicle.pose_at(now_s)
        near = self._bounds.too_near(pose.point) if self._bounds is not None and pose is not None else ""
        return Reason(WaitReason.ROOM_TO_BORDER, (near,)) if near else None

    @staticmethod
    def _stands_on(layout: MissionLayout, vehicle: VehicleState, now_s: float) -> bool:
        pose, base = vehicle.pose_at(now_s), layout.evidence.base
        return pose is not None and base.contains(base.cell_at(pose.point))

    def _lay(self, vehicle: VehicleState, now_s: float) -> Cleared | None:
        pose, mission, fence = vehicle.pose_at(now_s), self._run.mission, self._limits.fence
        if vehicle.origin is None or vehicle.home is None or pose is None:
            return None
        seen, settings = vehicle.scan_ahead or vehicle.scan, self._settings.current
        scan = None if seen is None else seen.scan
        mapping = settings_in_force(settings, scan, mission.rover.turning_radius_m).mapping
        origin, narrow = vehicle.origin.point, scan is not None and scan.is_narrow
        if self._previous is None or vehicle.position is None:
            layout = lay(mission, mapping, origin, vehicle.home.point, pose, fence, narrow_sight=narrow)
            progress = plan_progress(layout.targets, layout.start, mission.patrol, mission.commands, now_s)
            return Cleared(layout, progress)
        same = same_boot(self._previous.state, vehicle.position)
        return Cleared(
            *resumed_layout(
                self._previous, mission, mapping, origin, now_s, same=same, fence=fence, narrow_sight=narrow
            )
        )
