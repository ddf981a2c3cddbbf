"""A find as a campaign file of one run, so that anybody can drive it again, and a test can hold it."""

from __future__ import annotations

import json
import os
from pathlib import Path

from sitl.campaign.run_spec import RunSpec
from sitl.campaign.worded import GroundSpec, SensorSpec, Worded
from sitl.search.search import Find


def write_find(find: Find, file: Path, campaign: Path, command: str) -> None:
    """``campaign``: the file from which it was searched. Raises OSError."""
    spec, result = find.spec, find.result
    here = _from(campaign.resolve().parent, file.resolve().parent)
    world = spec.world if GroundSpec.of(spec.world) is not None else here(spec.world)
    sensors = SensorSpec.of(spec.sensors)
    lines = [
        f"# Found by: {command}",
        f"# {find.rule}: outcome {result.outcome}, touched {result.touched}, refused {result.refused}, "
        f"closest {result.clearance_m:g} m",
        f"worlds = [{json.dumps(world)}]",
        f"seed = {spec.seed}",
        "runs = 1",
        f"planners = [{json.dumps(spec.planner)}]",
        f"controllers = [{json.dumps(spec.controller)}]",
        f"sensors = [{json.dumps(_worded(spec.sensors, here(sensors.name)))}]",
        f"faults = [{json.dumps(here(spec.faults))}]",
        f"guard = [{json.dumps(spec.guard)}]",
        f"off_model = [{json.dumps(spec.off_model)}]",
        f"late_s = [{json.dumps(spec.late_s)}]",
        f"time_limit_s = {json.dumps(spec.time_limit_s)}",
        *_settings(spec),
    ]
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("\n".join([*lines, ""]), encoding="utf-8")


def differences(find: Find) -> str:
    """What differs from the usual, in words."""
    return str(Worded("", dict(find.values))).strip() or "nothing"


def _from(old: Path, new: Path):  # type: ignore[no-untyped-def]
    """Names of files that count from one folder, counted from another."""

    def named(name: str) -> str:
        return os.path.relpath(old / name, new) if name.endswith((".toml", ".plan", ".waypoints")) else name

    return named


def _worded(text: str, name: str) -> str:
    return str(Worded(name, Worded.of(text).values))


def _settings(spec: RunSpec) -> list[str]:
    lines = ["", f"[settings.{spec.settings}]"]
    for section, values in json.loads(spec.changes).items():
        lines += [f"{section} = {{ {', '.join(f'{key} = {json.dumps(value)}' for key, value in values.items())} }}"]
    return lines
