"""``rover-sitl campaign FILE --serve PORT``: serves the report, whose links drive runs again, until Ctrl-C."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import typer

from companion.cli.inputs import writable
from sitl.campaign.replay_server import Replay, Replays, ReplayServer, program
from sitl.campaign.run_spec import RunSpec
from sitl.campaign.run_store import Digests
from sitl.cli.runs import alone_in

REPORT, FOLDER = "report.html", "replays"


def replay_of(spec: RunSpec, digests: Digests, command: Sequence[str]) -> Replay:
    """A run that can be driven again. ``command``: see ``Replay``."""
    return Replay(spec.id, digests.of(spec), f"{spec.world}, {spec.controller}, seed {spec.seed}", command)


def serve_report(server: ReplayServer, place: Path, replays: Iterable[Replay]) -> None:
    """``place``: the folder of the report; records go into a folder beside it."""
    by_id, folder = {one.run_id: one for one in replays}, place / FOLDER
    writable(folder / REPORT)
    try:
        with alone_in(folder, "another program serves this report"):
            typer.echo(f"served at {server.url}, until Ctrl-C")
            server.serve(place / REPORT, Replays(folder, by_id, program))
    except KeyboardInterrupt:
        typer.echo("")
    finally:
        server.close()
