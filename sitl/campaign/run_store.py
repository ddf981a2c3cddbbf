"""The file of a campaign's results: one line a run, appended as it is done, checked when it is read.

A line is JSON: the run, its result, what code made it, and a check sum of the rest. A line that was torn by an end
before the time, or made by other code or of other files, does not count; a run counts once.

Nouns: run store.
"""

from __future__ import annotations

import hashlib
import json
import os
import zlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

from companion.core.own_parts import OwnKind, looks_own, sources_of
from companion.mapping.map_files import MapError
from companion.mission.load import load_mission
from companion.mission.mission import MissionError
from companion.mission.source_files import source_files
from companion.storage.files import read_at_most
from sitl.campaign.campaign_file import CampaignError
from sitl.campaign.policies import ERROR
from sitl.campaign.run_spec import RunResult, RunSpec
from sitl.campaign.worded import GroundSpec, SensorSpec
from sitl.experiments.experiment import code_digest
from sitl.generators.measures import Difficulty

MOST_BYTES = 2_000_000_000
UNREADABLE = (ValueError, KeyError, TypeError, AttributeError, RecursionError)
"""What a line raises that was torn, or written by something else."""


class RunStore:
    """Results by run."""

    def __init__(self, file: Path, digests: Callable[[RunSpec], str]) -> None:
        """``digests``: of the code and of the files of a run. Raises CampaignError when the file cannot be read."""
        self.file = file
        self.results: dict[str, RunResult] = {}
        self.torn = 0
        """Lines that could not be read."""
        self.older = 0
        """Lines of other code or other files."""
        self._digests = digests
        for line in _lines(file, repair=True):
            self._take(line)

    def add(self, spec: RunSpec, result: RunResult) -> None:
        """Append a result; it is on the disk before this returns. Raises OSError."""
        if spec.id in self.results:
            return
        body = {"run": asdict(spec), "result": asdict(result), "digest": self._digests(spec), "id": spec.id}
        line = json.dumps({**body, "check": _check_of(body)}, separators=(",", ":"))
        with self.file.open("a", encoding="utf-8") as out:
            out.write(line + "\n")
            out.flush()
            os.fsync(out.fileno())
        self.results[spec.id] = result

    def of(self, specs: Iterable[RunSpec]) -> list[tuple[RunSpec, RunResult]]:
        """These runs as far as they are done."""
        return [(spec, self.results[spec.id]) for spec in specs if spec.id in self.results]

    def _take(self, line: str) -> None:
        try:
            body = _body_of(line)
            spec, result = RunSpec(**body["run"]), _result(body["result"])
            is_ours = body["digest"] == self._digests(spec)
        except UNREADABLE:
            self.torn += 1
            return
        if not is_ours:
            self.older += 1
        elif result.outcome != ERROR:  # what failed on one machine for want of memory is driven again
            self.results.setdefault(spec.id, result)


def kept_run(file: Path, run_id: str) -> RunSpec | None:
    """The run of this name that a file has, whatever code has driven it; None: it has none.

    Raises CampaignError when the file cannot be read.
    """
    for line in _lines(file):
        try:
            body = _body_of(line)
            if body["id"] == run_id:
                return RunSpec(**body["run"])
        except UNREADABLE:
            continue
    return None


class Digests:
    """Names for the code as it stands and the files that a run depends on; each is read once, when first asked for."""

    def __init__(self, folder: Path) -> None:
        """``folder``: of the campaign's file."""
        self.folder = folder
        self._known: dict[tuple[str, ...], str] = {}

    def of(self, spec: RunSpec) -> str:
        """That of a run; empty where one of its files cannot be read, or where it says what this code does not know."""
        key = (spec.world, spec.planner, spec.controller, spec.sensors, spec.faults)
        if key not in self._known:
            digest = hashlib.sha256(code_digest().encode() + _libraries().encode())
            try:
                for file in _files(spec, self.folder):
                    digest.update(file.name.encode() + read_at_most(file, MOST_BYTES))
                self._known[key] = digest.hexdigest()[:16]
            except (OSError, MissionError, MapError, ValueError):
                self._known[key] = ""
        return self._known[key]


def _libraries() -> str:
    """Of what the code computes with: other versions of these may give other figures."""
    return " ".join(f"{name} {version(name)}" for name in ("numpy", "numba", "shapely"))


def _files(spec: RunSpec, folder: Path) -> Iterator[Path]:
    ground = GroundSpec.of(spec.world)
    if ground is None:
        yield from source_files(load_mission(folder / spec.world))
    parts = [(OwnKind.PLANNER, spec.planner), (OwnKind.CONTROLLER, spec.controller)]
    parts += [] if ground is None else [(OwnKind.WORLD, ground.kind)]
    yield from (folder / name for name in (spec.faults, SensorSpec.of(spec.sensors).name) if name.endswith(".toml"))
    for kind, name in parts:
        yield from sources_of(kind, name) if looks_own(kind, name) else ()


def _lines(file: Path, *, repair: bool = False) -> list[str]:
    """``repair``: nobody else writes to it."""
    try:
        data = read_at_most(file, MOST_BYTES) if file.exists() else b""
        if repair and data and not data.endswith(b"\n"):
            # A line that was torn: the next one must not be appended to it.
            with file.open("ab") as out:
                out.write(b"\n")
    except OSError as error:
        raise CampaignError(f"{file}: cannot be used: {error.strerror}; choose another folder with --out") from error
    return data.decode("utf-8", errors="replace").splitlines()


def _body_of(line: str) -> dict[str, Any]:
    """Raises one of ``UNREADABLE``."""
    body: dict[str, Any] = json.loads(line)
    if body.pop("check") != _check_of(body):
        raise ValueError("check sum")
    return body


def _result(values: dict[str, Any]) -> RunResult:
    dwelt = tuple((int(n), int(e), float(s)) for n, e, s in values["dwelt"])
    ground = None if values["ground"] is None else Difficulty(**values["ground"])
    return RunResult(**{**values, "dwelt": dwelt, "ground": ground})


def _check_of(body: dict[str, Any]) -> str:
    return f"{zlib.crc32(json.dumps(body, sort_keys=True).encode()):08x}"
