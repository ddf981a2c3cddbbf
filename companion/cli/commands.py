"""The commands of ``rover-companion``."""

from __future__ import annotations

from companion.cli.groups import group

app = group(
    "rover-companion",
    "Finds a rover's way to a mission's targets through unknown ground.",
    {
        "run": "companion.cli.run:run",
        "doctor": "companion.cli.doctor:doctor",
        "compile": "companion.cli.compile:compile_kernels",
        "params": "companion.cli.params:params",
        "guard": "companion.cli.guard:guard",
        "lidar": "companion.cli.lidar:lidar",
        "plan": "companion.cli.plan:plan",
        "replay": "companion.cli.replay:replay",
        "report": "companion.cli.report:report",
        "bench": "companion.cli.bench:bench",
        "check-planner": "companion.cli.check_planner:check_planner",
        "mission": "companion.cli.mission:app",
    },
)
