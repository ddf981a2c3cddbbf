"""The commands of ``rover-sitl``."""

from __future__ import annotations

from companion.cli.groups import group

app = group(
    "rover-sitl",
    "A light rover simulator that speaks ArduRover's MAVLink.",
    {
        "drive": "sitl.cli.drive:drive",
        "serve": "sitl.cli.serve:serve",
        "physics": "sitl.cli.physics:physics",
        "missions": "sitl.cli.missions:missions",
        "experiment": "sitl.cli.experiment:experiment",
        "campaign": "sitl.cli.campaign:campaign",
        "compare": "sitl.cli.compare:compare",
        "world": "sitl.cli.world:app",
    },
)
