"""What ``run`` prints and saves at its end, and its exit code."""

from __future__ import annotations

import contextlib
from pathlib import Path

import typer

from companion.app import Companion
from companion.cli.rig import Rig
from companion.control.model_estimate import described
from companion.executive.mission_progress import TargetStatus
from companion.mapping.map_files import MapError
from companion.mission.outline_hint import outline_hint
from companion.safety.reasons import PowerReason, Reason
from companion.storage.background_writer import BackgroundWorker, ShutdownBudget

EXIT_REACHED, EXIT_MISSED = 0, 3


def ended(companion: Companion, rig: Rig) -> int:
    """Print the result, and what could not be saved; returns the exit code."""
    code = print_statuses(companion.statuses(), companion.outcome.broken_off)
    code = code if companion.complete else EXIT_MISSED
    with contextlib.suppress(OSError):  # no reader: the exit code remains
        if companion.parting is not None:
            typer.echo(companion.parting, err=True)
        for line in (*companion.command_lines(), *map(str, companion.laps)):
            typer.echo(line)
        if any(status is TargetStatus.UNREACHABLE for _, status in companion.statuses()):
            hint = outline_hint(rig.mission.rover, rig.settings.guidance.controller)
            typer.echo(hint, nl=bool(hint))
        if companion.estimate is not None:
            typer.echo(f"the rover follows velocities {described(companion.estimate)}")
        for line in (rig.files.close(), rig.keeping.problem, str(rig.autopilot.codec.counters.refused)):
            if line:
                typer.echo(line, err=True)
        if rig.place is not None:
            _save_map(companion, rig.place, rig.budget)
            if rig.recorder.problem:
                typer.echo(rig.recorder.problem, err=True)
            shows = "" if companion.vehicle.heartbeat is None else f"; rover-companion report {rig.place} shows it"
            typer.echo(f"record: {rig.place}{shows}")
        if rig.stop.asked and code != EXIT_REACHED and rig.keeping.way_on:
            typer.echo(rig.keeping.way_on)
    return code


def print_statuses(statuses: list[tuple[str, TargetStatus]], broken_off: Reason[PowerReason] | None = None) -> int:
    """Print the status of each target, with the reason if the mission was broken off; returns the exit code."""
    with contextlib.suppress(OSError):
        for name, status in statuses:
            untried = status in (TargetStatus.SKIPPED, TargetStatus.PENDING)
            typer.echo(f"{name}: {status}{f' ({broken_off})' if broken_off is not None and untried else ''}")
    return EXIT_REACHED if all(status is TargetStatus.REACHED for _, status in statuses) else EXIT_MISSED


def _save_map(companion: Companion, directory: Path, budget: ShutdownBudget) -> None:
    """Write the map as ``map.yaml`` and ``map.pgm``; a disk that is full or hangs does not change the run's result."""
    place = directory / "map.yaml"
    told: list[tuple[str, bool]] = []

    def save() -> None:
        try:
            if companion.save_map(directory / "map"):
                told.append((f"map: {place}", False))
        except MapError as error:
            told.append((str(error), True))

    worker = BackgroundWorker("map", budget)
    worker.put(save)
    if not worker.close():
        told.append((f"{place}: not written: the disk does not answer", True))
    for line, err in told:
        typer.echo(line, err=err)
