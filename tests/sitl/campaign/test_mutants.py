"""A companion that is made wrong on purpose breaks the policy that forbids it, and one as it is breaks none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import companion.control.point_controller as points
import companion.control.safe_reach as reach
import companion.executive.mission_executor as executor
import companion.mavlink.ranges as ranges
import companion.safety.mode_latch as latch
import companion.safety.watchdogs as watchdogs
from companion.app import Companion
from companion.core.scan import RangeScan
from companion.executive.mission_progress import MissionProgress, TargetStatus, ended_early
from companion.executive.setpoint_sender import SetpointSender
from sitl.campaign.drive_run import drive
from sitl.campaign.policies import Policy, broken
from sitl.campaign.run_spec import RunResult, RunSpec
from tests.support.quick import first_of

WORLD = "size_m = [12.0, 20.0]\n[[obstacle]]\nline_m = [[4.0, 8.0], [8.0, 8.0]]\nwidth_m = 0.4\n"
MISSION = '[[target]]\nnorth_m = 0.0\neast_m = 10.0\n[sitl]\nworld = "world.toml"\nresolution_m = 1.0\nstart = [3, 6]\n'
Patch = pytest.MonkeyPatch


def ends_with_an_error(patch: Patch) -> None:
    def fails(self: Companion) -> None:
        raise ValueError("on the way")

    patch.setattr(Companion, "tick", fails)


def sees_nothing(patch: Patch) -> None:
    scan = ranges.obstacle_distance

    def blank(*given: Any) -> RangeScan | None:
        seen = scan(*given)
        return None if seen is None else replace(seen, range_m=np.full_like(seen.range_m, np.inf))

    patch.setattr(ranges, "obstacle_distance", blank)


def looks_only_at_the_last_moment(patch: Patch) -> None:
    """Where it plans, all ground counts as seen."""
    look = points.look_along
    for module in (points, reach):
        patch.setattr(module, "look_along", lambda *given: replace(look(*given), seen_m=1e9))
    patch.setattr(points.PointController, "_unseen_beside", lambda *given: None)


def gives_up_at_once(patch: Patch) -> None:
    def gives_up(progress: MissionProgress, now_s: float) -> MissionProgress:
        return replace(ended_early(progress), statuses=(TargetStatus.UNREACHABLE,))

    patch.setattr(executor, "on_time", gives_up)


def ends_the_mission_at_once(patch: Patch) -> None:
    patch.setattr(executor, "on_time", lambda progress, now_s: ended_early(progress))


def obeys_no_pilot(patch: Patch) -> None:
    patch.setattr(latch, "latched", lambda control, vehicle: latch.Control.COMPANION)


def never_notices_silence(patch: Patch) -> None:
    doubt = watchdogs.data_doubt
    patch.setattr(watchdogs, "data_doubt", lambda vehicle, now_s, safety: doubt(vehicle, now_s, _patient(safety, 1e9)))


def notices_silence_too_late(patch: Patch) -> None:
    doubt = watchdogs.data_doubt
    patch.setattr(watchdogs, "data_doubt", lambda vehicle, now_s, safety: doubt(vehicle, now_s, _patient(safety, 3.0)))


def _patient(safety: Any, stale_s: float) -> Any:
    return safety.model_copy(update={"stale_s": stale_s})


def says_nothing(patch: Patch) -> None:
    patch.setattr(SetpointSender, "speak", lambda *given, **named: None)


MUTANTS: list[tuple[Callable[[Patch], None], str, Policy]] = [
    (gives_up_at_once, "none", Policy.NO_FALSE_UNREACHABLE),
    (ends_with_an_error, "none", Policy.NO_ERROR),
    (ends_the_mission_at_once, "none", Policy.LEAVES_NONE_OUT),
    (sees_nothing, "none", Policy.NO_CONTACT),
    (looks_only_at_the_last_moment, "none", Policy.NOTHING_REFUSED),
    (obeys_no_pilot, "pilot start_s=2 since=driving mode=MANUAL", Policy.PILOT_WINS),
    (never_notices_silence, "sensor_silent start_s=2 since=driving duration_s=3", Policy.NOT_BLIND),
    (notices_silence_too_late, "sensor_silent start_s=2 since=driving duration_s=6", Policy.NOT_BLIND),
    (
        notices_silence_too_late,
        "sensor_silent start_s=2 since=driving duration_s=6; packet_delay start_s=500 duration_s=1 delay_s=1.5",
        Policy.NOT_BLIND,
    ),
    (says_nothing, "none", Policy.ENDS),
]


def driven(folder: Path, faults: str, sensors: str = "lidar-360") -> RunResult:
    (folder / "world.toml").write_text(WORLD)
    (folder / "mission.toml").write_text(MISSION)
    spec = RunSpec(
        "mission.toml", "hybrid", "points", sensors, faults, False, 0.0, 0.0, "shipped", 1, 75.0, False, "{}"
    )
    return drive(spec, folder)


@first_of(1, ("mutant", "faults", "policy"), MUTANTS)
def test_a_companion_made_wrong_breaks_the_policy(
    tmp_path: Path, monkeypatch: Patch, mutant: Callable[[Patch], None], faults: str, policy: Policy
) -> None:
    mutant(monkeypatch)
    assert policy in broken(driven(tmp_path, faults))


@pytest.mark.thorough
@pytest.mark.parametrize("faults", sorted({faults for _, faults, _ in MUTANTS}))
def test_a_companion_as_it_is_breaks_none(tmp_path: Path, faults: str) -> None:
    result = driven(tmp_path, faults)
    assert broken(result) == () and result.metres > 1.0


def test_there_is_one_for_each_policy() -> None:
    assert {policy for *_, policy in MUTANTS} == {*Policy}
