"""A record as tables for other programs: poses, decisions and setpoints as CSV files.

Nouns: CSV report.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from pathlib import Path

from companion.app import Companion
from companion.core.frames import LocalFrame, NedPoint
from companion.mavlink.sent import told_by
from companion.navigation.field_step import Decision
from companion.planning.problem import Path as FieldPath
from companion.recording.record_clock import RecordClock
from companion.replay.replay import ReplayObserver
from companion.vehicle.commands import ChangeSpeed, GuidedHeading, GuidedPosition, GuidedVelocity
from companion.vehicle.mode_names import mode_name
from companion.vehicle.state import VehicleState
from companion.viewer.steady_frame import SteadyFrame

TIME = ("time_s", "time_utc")
PLACE = ("north_m", "east_m", "latitude_deg", "longitude_deg")
POSE = (*TIME, *PLACE, "heading_deg", "speed_m_s", "turn_rate_deg_s", "mode", "armed", "doing")
DECISION = (
    *TIME, "number", *PLACE, "target", "action", "part", "reason", "path_m", "path_fields", "cost", "searches",
    "planner", "proved",
)  # fmt: skip
SETPOINT = (*TIME, "kind", *PLACE, "heading_deg", "forward_m_s", "turn_rate_deg_s", "speed_m_s")
FILES = {"pose.csv": POSE, "decisions.csv": DECISION, "setpoints.csv": SETPOINT}
Value = str | float | None


class CsvReport(ReplayObserver):
    """Writes the three files while a record is run again, a row for each position, decision and setpoint.

    An empty cell: not known, or does not apply. Opening and ``close`` raise OSError.
    """

    def __init__(self, files: Mapping[str, Path], clock: RecordClock) -> None:
        """``files``: where each of ``FILES`` is written."""
        self._clock = clock
        self._files = ExitStack()
        self._position_s = -math.inf
        self._steady = SteadyFrame()
        writers = []
        for name, head in FILES.items():
            file = self._files.enter_context(files[name].open("w", encoding="utf-8", newline=""))
            writers.append(csv.writer(file, lineterminator="\n"))
            writers[-1].writerow(head)
        self._poses, self._decisions, self._setpoints = writers

    def close(self) -> None:
        """Write what is left."""
        self._files.close()

    def decided(self, companion: Companion, number: int, time_s: float, target: str, decision: Decision) -> None:
        """See ``ReplayObserver``."""
        pose, evidence, driver = companion.status().pose, companion.evidence, companion.driver
        metres = 1.0 if evidence is None else evidence.base.resolution_m
        length = FieldPath(decision.path, 0.0).length_fields if decision.path else None
        row: list[Value] = [
            number,
            *self._place(companion.vehicle, None if pose is None else pose.point),
            target,
            str(decision.action),
            str(decision.part),
            str(decision.reason),
            _rounded(None if length is None else metres * length, 2),
            len(decision.path),
            _rounded(None if decision.new_path is None else decision.new_path.cost, 3),
            " ".join(decision.searches),
            driver.searcher.planner.name if decision.searches and driver is not None else "",
            _yes(decision.proved),
        ]
        self._decisions.writerow(self._filled(time_s, row))

    def said(self, companion: Companion, time_s: float, raw: bytes) -> None:
        """See ``ReplayObserver``."""
        vehicle = companion.vehicle
        nowhere: list[Value] = [None] * len(PLACE)
        match told_by(raw, None if vehicle.origin is None else vehicle.origin.point):
            case GuidedPosition(point):
                row: list[Value] = ["position", *self._place(vehicle, point)]
            case GuidedHeading(heading_rad):
                row = ["heading", *nowhere, _degrees(heading_rad)]
            case GuidedVelocity(forward_m_s, yaw_rate_rad_s):
                row = ["velocity", *nowhere, None, _rounded(forward_m_s, 3), _degrees(yaw_rate_rad_s)]
            case ChangeSpeed(speed_m_s):
                row = ["speed", *nowhere, None, None, None, _rounded(speed_m_s, 3)]
            case _:
                return
        row += [None] * (len(SETPOINT) - len(TIME) - len(row))
        self._setpoints.writerow(self._filled(time_s, row))

    def ticked(self, companion: Companion, time_s: float) -> None:
        """See ``ReplayObserver``."""
        vehicle, status = companion.vehicle, companion.status()
        if vehicle.position is None or vehicle.position.time_s == self._position_s or status.pose is None:
            return
        self._position_s = vehicle.position.time_s
        turn_rad_s = None if vehicle.attitude is None else vehicle.attitude.yaw_rate_rad_s
        row: list[Value] = [
            *self._place(vehicle, status.pose.point),
            _degrees(status.pose.heading_rad % (2.0 * math.pi)),
            _rounded(vehicle.forward_m_s, 3),
            None if turn_rad_s is None else _degrees(turn_rad_s),
            mode_name(vehicle),
            "" if vehicle.heartbeat is None else _yes(vehicle.heartbeat.armed),
            status.doing,
        ]
        self._poses.writerow(self._filled(time_s, row))

    def _filled(self, time_s: float, row: Iterable[Value]) -> list[Value]:
        values: list[Value] = [_rounded(time_s, 3), self._clock.utc(time_s), *row]
        return ["" if value is None else value for value in values]

    def _place(self, vehicle: VehicleState, point: NedPoint | None) -> list[Value]:
        """North and east in metres of the run's first origin; latitude and longitude where an origin is known."""
        if point is None:
            return [None] * len(PLACE)
        origin = None if vehicle.origin is None else vehicle.origin.point
        self._steady.note(origin)
        steady, geo = self._steady.point(point), None if origin is None else LocalFrame(origin).to_geo(point)
        degrees: list[Value] = [None, None] if geo is None else [round(geo.lat_deg, 8), round(geo.lon_deg, 8)]
        return [_rounded(steady.north_m, 3), _rounded(steady.east_m, 3), *degrees]


def _degrees(angle_rad: float) -> Value:
    return _rounded(math.degrees(angle_rad), 2)


def _rounded(value: float | None, digits: int) -> Value:
    """Without a zero that has a sign."""
    return None if value is None else round(value, digits) + 0.0


def _yes(is_so: bool) -> str:
    return "yes" if is_so else "no"
