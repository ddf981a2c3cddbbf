"""A find as a campaign file of one run, so that anybody can drive it again, and a test can hold it."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

from companion.storage.files import whole_file
from sitl.campaign.run_spec import RunSpec
from sitl.campaign.worded import GroundSpec, Worded
from sitl.search.search import Find


def counted_from(spec: RunSpec, campaign: Path, folder: Path) -> RunSpec:
    """The same run for a campaign in ``folder``: the files that it names count from there.

    ``campaign``: the file that it comes from.
    """

    def here(name: str) -> str:
        old, new = campaign.resolve().parent, folder.resolve()
        return os.path.relpath(old / name, new) if name.endswith((".toml", ".plan", ".waypoints")) else name

    sensors = Worded.of(spec.sensors)
    world = spec.world if GroundSpec.of(spec.world) is not None else here(spec.world)
    return replace(spec, world=world, sensors=str(Worded(here(sensors.name), sensors.values)), faults=here(spec.faults))


def write_find(find: Find, spec: RunSpec, file: Path, command: str) -> None:
    """``spec``: the run as it counts from the file's folder. Raises OSError."""
    result = find.result
    lines = [
        f"# Found by: {command}",
        f"# {find.rule}: outcome {result.outcome}, touched {result.touched}, refused {result.refused}, "
        f"closest {result.clearance_m:g} m",
        f"worlds = [{json.dumps(spec.world)}]",
        f"seed = {spec.seed}",
        "runs = 1",
        f"planners = [{json.dumps(spec.planner)}]",
        f"controllers = [{json.dumps(spec.controller)}]",
        f"sensors = [{json.dumps(spec.sensors)}]",
        f"faults = [{json.dumps(spec.faults)}]",
        f"guard = [{json.dumps(spec.guard)}]",
        f"off_model = [{json.dumps(spec.off_model)}]",
        f"late_s = [{json.dumps(spec.late_s)}]",
        f"time_limit_s = {json.dumps(spec.time_limit_s)}",
        f"person = {json.dumps(spec.person)}",
        f"autopilot_on_s = {json.dumps(spec.autopilot_on_s)}",
        *_settings(spec),
    ]
    file.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(file) as new:
        new.write_text("\n".join([*lines, ""]), encoding="utf-8")


def differences(find: Find) -> str:
    """What differs from the usual, in words."""
    return str(Worded("", dict(find.values))).strip() or "nothing"


def _settings(spec: RunSpec) -> list[str]:
    lines = ["", f"[settings.{spec.settings}]"]
    for section, values in json.loads(spec.changes).items():
        lines += [f"{section} = {{ {', '.join(f'{key} = {json.dumps(value)}' for key, value in values.items())} }}"]
    return lines
