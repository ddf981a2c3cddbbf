"""What one ``run`` consists of beside the companion itself."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from companion.cli.live import Live
from companion.cli.live_view import LiveView
from companion.cli.state import RunState, StateFiles
from companion.cli.stop_signals import StopSignals
from companion.lidar.reader import Lidars
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mavlink.transport import ByteLink
from companion.mission.mission import Mission
from companion.recording.recorder import NullRecorder, Recorder
from companion.settings import Settings
from companion.storage.background_writer import ShutdownBudget
from companion.viewer.live_viewer import LiveViewer


@dataclass(frozen=True, slots=True)
class Rig:
    """The objects of a run. ``place``: the folder of its record; None without one."""

    mission: Mission
    settings: Settings
    link: ByteLink
    autopilot: AutopilotLink
    recorder: Recorder | NullRecorder
    place: Path | None
    keeping: RunState
    files: StateFiles
    live: Live | LiveView
    stop: StopSignals
    budget: ShutdownBudget
    page: LiveViewer | None
    lidars: Lidars
