"""A run of a mission on a desk: real executor and sender, no simulator; the vehicle is what a test says."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from companion.core.frames import NedPoint
from companion.core.scan import RangeScan
from companion.executive.mission_executor import MissionExecutor
from companion.executive.mission_layout import MissionLayout, lay
from companion.executive.mission_progress import MissionProgress, plan_progress
from companion.executive.mission_run import MissionRun
from companion.executive.setpoint_sender import SetpointSender
from companion.navigation.step_runner import InlineRunner
from companion.recording.recorder import NullRecorder
from companion.settings import Settings
from companion.settings.live_settings import LiveSettings
from companion.vehicle.events import AttitudeSeen, HeartbeatSeen, LocalPositionSeen, RangeSeen
from companion.vehicle.state import VehicleState
from tests.companion.safety.test_mode_latch import GUIDED, PLACE, vehicle
from tests.support.fake_autopilot import FakeAutopilot
from tests.support.notices import HandClock, Notices
from tests.support.rig import GATE, yard


class Desk:
    """The mission begins at the origin, which is home; ``now_s`` goes on by a tick with every ``step``."""

    def __init__(
        self, folder: Path, targets: str = GATE, settings: Settings | None = None, **yard_options: bool
    ) -> None:
        self.mission = yard(folder, targets, **yard_options)
        self.settings = LiveSettings(settings or Settings())
        self.notices, self.autopilot, self.clock = Notices(), FakeAutopilot(), HandClock(10.0)
        link: Any = self.autopilot
        sender = SetpointSender(link, self.settings, self.notices)
        self.run = MissionRun(self.mission, vehicle(10.0), sender, self.settings, self.notices, self._executor)

    @property
    def now_s(self) -> float:
        return self.clock.time_s

    @property
    def executor(self) -> MissionExecutor:
        assert self.run.executor is not None
        return self.run.executor

    def begin(self) -> MissionExecutor:
        pose = self.run.vehicle.pose_at(self.now_s)
        assert pose is not None
        layout = lay(self.mission, self.settings.current.mapping, PLACE, PLACE, pose)
        return self.run.begin(layout, plan_progress(layout.targets, layout.start), self.now_s)

    def stand(self, north_m: float, east_m: float, *, mode: int = GUIDED, armed: bool = True) -> VehicleState:
        """The vehicle as it is heard now, standing there; what it sees all round is free."""
        now_s = self.now_s
        bearings = np.radians(np.arange(-180.0, 180.0, 4.0))
        scan = RangeScan(now_s, bearings, np.full(len(bearings), np.inf), 0.1, 8.0, 0.1, "lidar")
        self.run.vehicle = replace(
            self.run.vehicle,
            heartbeat=HeartbeatSeen(now_s, mode, armed, 1),
            position=LocalPositionSeen(now_s, now_s, north_m, east_m, 0.0, 0.0),
            attitude=AttitudeSeen(now_s, now_s, 0.0, 0.0),
            scan=RangeSeen(now_s, scan),
            scan_ahead=RangeSeen(now_s, scan),
        )
        return self.run.vehicle

    def at(self, point: NedPoint) -> VehicleState:
        return self.stand(point.north_m, point.east_m)

    def _executor(self, layout: MissionLayout, progress: MissionProgress, scan: RangeScan) -> MissionExecutor:
        rng = np.random.default_rng(0)
        return MissionExecutor(
            self.mission,
            self.settings,
            layout,
            progress,
            scan,
            InlineRunner(),
            NullRecorder(),
            self.notices,
            rng,
        )
