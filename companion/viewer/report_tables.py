"""Tables of a report: targets, the run in figures, stops, watchdogs, and how several runs differ.

Nouns: report table.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from companion.control.model_estimate import described
from companion.replay.replay import ReplayResult
from companion.viewer.frame import NOT_REACHED
from companion.viewer.run_tally import RunTally, Spell

NOT_KNOWN, NBSP = "-", "\N{NO-BREAK SPACE}"
Json = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Run:
    """A run as the tables see it. ``contacts``: None where nobody knows them, as on a real rover."""

    name: str
    mission: str
    tally: RunTally
    result: ReplayResult
    contacts: int | None


def tables_of(run: Run) -> list[Json]:
    """The tables of one run."""
    done = (_commands(run.result), _laps(run.result))
    return [
        _targets(run),
        *(table for table in done if table["rows"]),
        _figures(run),
        _stops(run.tally),
        _watchdogs(run.tally),
    ]


def differences(runs: Sequence[Run]) -> Json:
    """What several runs came to; behind a figure how far it is from that of the first."""
    rows = [
        [
            title,
            *(_compared(value, values[0], digits) if number else _number(value, digits)
              for number, value in enumerate(values)),
        ]
        for title, digits, values in _comparable(runs)
    ]  # fmt: skip
    missions = [run.mission for run in runs]
    if len(set(missions)) > 1:
        rows.insert(0, ["mission (they differ)", *missions])
    return {"title": "Differences", "head": ["", *(run.name for run in runs)], "rows": rows}


def _comparable(runs: Sequence[Run]) -> list[tuple[str, int, list[float | None]]]:
    """Rows of figures with their decimals."""
    tallies = [run.tally for run in runs]
    return [
        (f"time,{NBSP}s", 1, [one.seconds for one in tallies]),
        (f"driven,{NBSP}m", 1, [one.driven_m for one in tallies]),
        ("targets reached", 0, [one.reached for one in tallies]),
        ("stops", 0, [one.stops for one in tallies]),
        (f"stopped,{NBSP}s", 1, [one.stopped_s for one in tallies]),
        ("decisions", 0, [one.decisions for one in tallies]),
        ("searches", 0, [one.searches for one in tallies]),
        ("contacts", 0, [run.contacts for run in runs]),
        (f"energy,{NBSP}Wh", 2, [one.energy.energy_wh for one in tallies]),
    ]


def _number(value: float | None, digits: int) -> str:
    return NOT_KNOWN if value is None else f"{value:.{digits}f}"


def _compared(value: float | None, first: float | None, digits: int) -> str:
    if value is None or first is None:
        return _number(value, digits)
    off = round(value, digits) - round(first, digits)
    return f"{value:.{digits}f} ({'±0' if round(off, digits) == 0 else f'{off:+.{digits}f}'})"


def _targets(run: Run) -> Json:
    """What became of each target, when, and how far the way was; of a patrol in the lap that was begun last."""
    laps = () if run.result.companion is None else run.result.companion.laps
    rows = [
        [
            leg.name,
            str(NOT_REACHED.get(leg.status, leg.status)),
            *(_number(value, 1) for value in (leg.ended_s, leg.driven_m, leg.straight_m)),
        ]
        for leg in run.tally.legs
    ]
    title = "Targets, in the last lap" if laps else "Targets"
    return {"title": title, "head": ["target", "status", "at s", "driven m", "straight m"], "rows": rows}


def _commands(result: ReplayResult) -> Json:
    """What became of each command of the mission."""
    lines = [] if result.companion is None else result.companion.command_lines()
    rows = [list(line.rsplit(": ", 1)) for line in lines]
    return {"title": "Commands", "head": ["command", "result"], "rows": rows}


def _laps(result: ReplayResult) -> Json:
    """The laps of a patrol."""
    laps = () if result.companion is None else result.companion.laps
    rows = [
        [f"{lap.number}", f"{lap.seconds:.0f}", f"{lap.driven_m:.0f}", ", ".join(lap.missed) or "none", f"{lap.failed}"]
        for lap in laps
    ]
    return {"title": "Laps", "head": ["lap", "s", "m", "targets missed", "commands failed"], "rows": rows}


def _figures(run: Run) -> Json:
    """The whole run in figures."""
    tally, result = run.tally, run.result
    mean = tally.driven_m / tally.moving_s if tally.moving_s else 0.0
    energy, charge = tally.energy.energy_wh, tally.energy.charge_ah
    per_km = None if energy is None or tally.driven_m < 1.0 else energy / tally.driven_m * 1000.0
    rows = [
        ["time", f"{result.seconds:.1f} s"],
        ["driven", f"{tally.driven_m:.1f} m"],
        ["of that backwards", f"{tally.backwards_m:.1f} m"],
        ["mean speed while moving", f"{mean:.2f} m/s"],
        ["stopped, held up not counted", f"{tally.stopped_s:.1f} s, {tally.stops} time{'s' * (tally.stops != 1)}"],
        ["energy from the battery", _with_unit(energy, 2, "Wh")],
        ["charge from the battery", _with_unit(charge, 3, "Ah")],
        ["energy for each km", _with_unit(per_km, 1, "Wh")],
        ["contacts", _number(run.contacts, 0)],
        ["decisions", f"{tally.decisions}"],
        ["searches", f"{tally.searches}"],
        ["packets heard", f"{result.heard}"],
        ["packets sent", f"{result.said}"],
        ["differences of the replay", f"{len(result.differences) or 'none'}"],
    ]
    full_m_s = None if result.companion is None else result.companion.full_throttle_m_s
    rows += [] if full_m_s is None else [["speed at full throttle, as found", f"{full_m_s:.1f} m/s"]]
    estimate = None if result.companion is None else result.companion.estimate
    rows += [] if estimate is None else [["how it follows velocities", described(estimate)]]
    return {"title": "The run", "head": ["", ""], "rows": rows}


def _with_unit(value: float | None, digits: int, unit: str) -> str:
    return NOT_KNOWN if value is None else f"{value:.{digits}f} {unit}"


def _stops(tally: RunTally) -> Json:
    """How long the rover stood, by reason."""
    head = ["reason", "times", "seconds", "first at s"]
    return {"title": "Stops and waits", "head": head, "rows": _spells(tally.stood)}


def _watchdogs(tally: RunTally) -> Json:
    """What kept the rover from moving, by the watchdogs' reasons."""
    head = ["watchdog", "times", "seconds", "first at s"]
    return {"title": "Watchdogs", "head": head, "rows": _spells(tally.watchdogs)}


def _spells(spells: dict[str, Spell]) -> list[list[str]]:
    """Rows, the longest first."""
    longest = sorted(spells.items(), key=lambda one: (-one[1].seconds, one[0]))
    rows = [[name, f"{one.times}", f"{one.seconds:.1f}", f"{one.first_s:.1f}"] for name, one in longest]
    return rows or [["none", NOT_KNOWN, NOT_KNOWN, NOT_KNOWN]]
