"""From a link to a rover that may be driven: what is still missing, and the one command that would help."""

from __future__ import annotations

import math
from dataclasses import dataclass

from companion.checkpoint.resume import Kept, Ownership, lay_resumed, ownership, same_boot
from companion.control.controller import STANDSTILL
from companion.executive.mission_layout import MissionLayout, lay
from companion.executive.mission_progress import TargetStatus
from companion.mission.bounds import Bounds
from companion.mission.fence import NO_FENCE, AutopilotFence
from companion.mission.mission import Mission, MissionError
from companion.safety.mode_latch import Control, data_reason
from companion.settings import SafetySettings, Settings
from companion.vehicle.commands import Arm, Command, SetMode
from companion.vehicle.events.vehicle import AckSeen, HeartbeatSeen, RoverMode
from companion.vehicle.state import VehicleState

ASK_AGAIN_S = 3.0
"""The next command is given after so long, and one that has not worked again,"""
AGAIN_RESUMED_S = 1.0
"""and by a run that is to go on as soon as the autopilot lets itself be armed, after so long."""
TAKEN_S = 0.5
"""A heartbeat so long after the answer to a mode change shows what has become of it."""
LEFT_S = 10.0
"""A rover that an earlier run has left armed in GUIDED, and that cannot be driven for so long, is put into HOLD and left to a person."""
LOOK_AGAIN_S = 2.0
"""A rover that stands beside the mission's grid is looked at again after so long."""


@dataclass(frozen=True, slots=True)
class StartStep:
    """``missing`` is empty when the rover may be driven; otherwise it says in words what is awaited."""

    missing: str
    command: Command | None = None


def start_step(
    vehicle: VehicleState,
    now_s: float,
    settings: SafetySettings,
    *,
    arm: bool,
    control: Control = Control.NOBODY,
    hindrance: str = "",
) -> StartStep:
    """What stands between now and driving. ``hindrance``: anything else that must be out of the way before GUIDED is set.

    GUIDED is set only on a rover that nobody drives (disarmed, or in HOLD), and never on one that a person has had
    (``control``); arming only if told to (``arm``).
    """
    if vehicle.heartbeat is None:
        return StartStep("the autopilot's heartbeat")
    if vehicle.origin is None or vehicle.home is None:
        return StartStep("the autopilot's origin and home")
    reason = data_reason(vehicle, now_s, settings)
    if reason:
        return StartStep(f"good data ({reason})")
    if hindrance:
        return StartStep(hindrance)
    if vehicle.in_auto:
        ready = vehicle.heartbeat.mode == RoverMode.AUTO and vehicle.heartbeat.armed
        return StartStep("" if ready else "a person to arm and to set AUTO (the autopilot drives this mission)")
    if vehicle.heartbeat.mode != RoverMode.GUIDED:
        if vehicle.heartbeat.armed and vehicle.heartbeat.mode != RoverMode.HOLD:
            return StartStep("a person to set GUIDED (somebody is driving)")
        if control is Control.PERSON:
            return StartStep("a person to set GUIDED (a person has had the rover)")
        return StartStep("GUIDED", SetMode(RoverMode.GUIDED))
    if not vehicle.heartbeat.armed:
        return StartStep("arming", Arm()) if arm else StartStep("a person to arm (or run with --arm)")
    return StartStep("")


def overruled(ack: AckSeen | None, heartbeat: HeartbeatSeen | None) -> bool:
    """Whether somebody has chosen another mode since the autopilot took ours, though no heartbeat showed GUIDED between."""
    if ack is None or ack.result != 0 or heartbeat is None:
        return False
    return heartbeat.mode != RoverMode.GUIDED and heartbeat.time_s - ack.time_s > TAKEN_S


class StartUp:
    """The way there, tick by tick. ``missing`` says in words what is awaited."""

    def __init__(self, mission: Mission, settings: Settings, *, arm: bool, kept: Kept | None = None) -> None:
        """``kept``: the run that is to be taken up."""
        self.missing = ""
        self.found = ""
        """What is to be said of a run that has been taken up."""
        self.held = ""
        """Why a rover that an earlier run has left armed is put into HOLD, in words."""
        self._kept = kept
        self._owner: Ownership | None = None
        self._mission = mission
        self._settings = settings
        self._arm = arm
        self._asked: Command | None = None
        self._asked_s = -math.inf
        self._mode: int | None = None
        self._persons = False
        self._left_since_s = math.inf
        self._look_again_s = -math.inf
        self._checked: tuple[object, ...] = ()
        self._bounds: Bounds | None = None

    def retune(self, settings: Settings) -> None:
        """Other settings from now on."""
        self._settings = settings

    def step(
        self,
        vehicle: VehicleState,
        control: Control,
        now_s: float,
        fence: AutopilotFence = NO_FENCE,
        hindrance: str = "",
    ) -> tuple[MissionLayout | None, Command | None]:
        """The mission on the ground once the rover may be driven; until then the command to give now, if any.

        ``fence``: the autopilot's own. ``hindrance``: see ``start_step``. Raises MissionError as soon as it is known that the mission
        cannot be laid out, or (unless it is taken up) has a target behind a fence, before anybody arms.
        """
        if now_s < self._look_again_s:
            return None, None
        self._check(vehicle, now_s, fence)
        hindrance = hindrance or self._stands_too_near(vehicle, now_s)
        control = Control.PERSON if self._had_by_person(vehicle) else self._whose(vehicle, control)
        # Whoever disarms the rover does not want it armed again by itself.
        self._arm = self._arm and not (vehicle.heartbeat is not None and vehicle.heartbeat.armed)
        step = start_step(vehicle, now_s, self._settings.safety, arm=self._arm, control=control, hindrance=hindrance)
        self.missing = step.missing
        if step.missing:
            return None, self._due(step.command or self._standstill(vehicle, now_s), now_s)
        layout, pose = self._lay(vehicle, now_s, fence), vehicle.pose_at(now_s)
        if (
            layout is not None
            and pose is not None
            and layout.evidence.base.contains(layout.evidence.base.cell_at(pose.point))
        ):
            return layout, None
        self.missing = "the rover to stand on the mission's grid"
        self._look_again_s = now_s + LOOK_AGAIN_S
        return None, self._standstill(vehicle, now_s)

    def out(self, vehicle: VehicleState) -> bool:
        """Whether the rover is where an earlier run has left it, armed in GUIDED: nobody else may be there.

        While AUTO is served, GUIDED is a person's.
        """
        ours = self._kept is not None and self._kept.state.control is Control.COMPANION and not vehicle.in_auto
        heartbeat = vehicle.heartbeat
        return ours and heartbeat is not None and heartbeat.mode == RoverMode.GUIDED and heartbeat.armed

    def _standstill(self, vehicle: VehicleState, now_s: float) -> Command | None:
        """A rover that an earlier run had set going stops until it is known what it drives on, and is in HOLD if that takes long."""
        if not self.out(vehicle):
            self._left_since_s = math.inf
            return None
        self._left_since_s = min(self._left_since_s, now_s)
        if now_s - self._left_since_s < LEFT_S and not vehicle.sticks.moved:
            return STANDSTILL.setpoint
        self.held = "the sticks were moved" if vehicle.sticks.moved else f"waited too long for {self.missing}"
        self._owner = Ownership(Control.PERSON, may_arm=False)
        return SetMode(RoverMode.HOLD)

    def _due(self, command: Command | None, now_s: float) -> Command | None:
        """The command, if it is not too soon; a run that is taken up waits only with one that has just been given."""
        if self._kept is None:
            soon = now_s - self._asked_s <= ASK_AGAIN_S
        else:
            soon = command == self._asked and now_s - self._asked_s <= AGAIN_RESUMED_S
        if command is None or soon:
            return None
        self._asked, self._asked_s = command, now_s
        return command

    def _had_by_person(self, vehicle: VehicleState) -> bool:
        """Whether a person has driven it, or taken it out of our mode, since this run looks on, and has not set our mode since."""
        if (heartbeat := vehicle.heartbeat) is None:
            return False
        if heartbeat.mode == vehicle.own_mode:
            self._persons = False
        elif self._mode == vehicle.own_mode or (heartbeat.armed and heartbeat.mode != RoverMode.HOLD):
            self._persons = True
        self._mode = heartbeat.mode
        return self._persons

    def _whose(self, vehicle: VehicleState, control: Control) -> Control:
        """Who drives, where an earlier run had the rover: looked at once, then by the mode as ever."""
        if self._owner is None and self._kept is not None:
            self._owner = ownership(self._kept.state, vehicle)
            self._arm = self._arm and (self._owner is None or self._owner.may_arm)
        return self._owner.control if self._owner is not None and control is Control.NOBODY else control

    def _check(self, vehicle: VehicleState, now_s: float, fence: AutopilotFence) -> None:
        """Lay the mission out to see whether it can be: once, and again when origin, home or fence are others."""
        ground = (vehicle.origin and vehicle.origin.point, vehicle.home and vehicle.home.point, fence)
        if ground == self._checked:
            return
        layout = self._lay(vehicle, now_s, fence)
        if layout is None:
            return
        # One that a fence has closed while nobody listened is no error of whoever starts: it is refused when its turn comes, as on the way.
        for number, reason in layout.refused.items() if self._kept is None else ():
            if layout.progress.statuses[number] is TargetStatus.PENDING:
                raise MissionError(f"{self._mission.source or self._mission.name}: {reason}")
        self._checked, self._bounds = ground, layout.bounds

    def _stands_too_near(self, vehicle: VehicleState, now_s: float) -> str:
        pose = vehicle.pose_at(now_s)
        near = self._bounds.too_near(pose.point) if self._bounds is not None and pose is not None else ""
        return f"the rover to stand {near}" if near else ""

    def _lay(self, vehicle: VehicleState, now_s: float, fence: AutopilotFence) -> MissionLayout | None:
        pose = vehicle.pose_at(now_s)
        if vehicle.origin is None or vehicle.home is None or pose is None:
            return None
        origin, mapping = vehicle.origin.point, self._settings.mapping
        if self._kept is None or vehicle.position is None:
            return lay(self._mission, mapping, origin, vehicle.home.point, pose, fence)
        same = same_boot(self._kept.state, vehicle.position)
        layout, self.found = lay_resumed(self._kept, self._mission, mapping, origin, now_s, same=same, fence=fence)
        return layout
