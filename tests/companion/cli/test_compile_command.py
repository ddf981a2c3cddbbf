"""``rover-companion compile``: what it runs, in which order, and what it says."""

from __future__ import annotations

import contextlib
import os
import pty
import signal
import time
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from companion.cli import compile as compiling
from companion.cli.commands import app
from companion.cli.compile import AFTER, Chosen, done_one_by_one, drive, genetic_planner, graph_searches, manoeuvres
from companion.settings import Settings


def run(*words: object) -> Any:
    return CliRunner().invoke(app, ["compile", *map(str, words)])


def quick(name: str) -> Any:
    job = partial(os.getpid)
    job.__name__ = name  # type: ignore[attr-defined]
    return job


def test_nothing_to_do_is_said() -> None:
    """The tests begin with compiled kernels."""
    answer = run()
    assert (
        answer.exit_code == 0
        and answer.output == f"nothing to do: the kernels are in {os.environ['NUMBA_CACHE_DIR']}\n"
    )


def test_bad_settings_are_one_line(tmp_path: Path) -> None:
    answer = run("--settings", tmp_path / "none.toml")
    assert answer.exit_code == 2 and answer.output.count("\n") == 1


def test_a_line_for_each_part_where_nobody_looks(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    cold(monkeypatch, tmp_path)
    done = ["a", "b", "c", "d"]
    monkeypatch.setattr(compiling, "done_one_by_one", lambda jobs, after, processes: map(quick, done))
    answer = run("--jobs", 1)
    lines = answer.output.splitlines()
    assert answer.exit_code == 0 and [line.split("(")[0].strip() for line in lines[:-1]] == [
        f"compiled {n} of 4: {name}" for n, name in enumerate(done, 1)
    ]
    assert lines[-1].startswith("compiled in 0 s; the kernels are in ")


def test_one_line_with_a_bar_for_a_person(monkeypatch: pytest.MonkeyPatch) -> None:
    from rich.console import Console

    monkeypatch.setattr(compiling, "done_one_by_one", lambda jobs, after, processes: map(quick, "ab"))
    ours, theirs = pty.openpty()
    keep = os.dup(theirs)  # what was drawn is gone once the last of its end is closed
    os.set_blocking(ours, False)
    with os.fdopen(theirs, "w") as terminal:
        compiling._show(Console(file=terminal, force_terminal=True, width=80), [drive, manoeuvres], None)
    drawn = ""
    with contextlib.suppress(OSError):  # nothing more
        while data := os.read(ours, 65536):
            drawn += data.decode(errors="replace")
    os.close(ours)
    os.close(keep)
    assert "compiled: b" in drawn and "2/2" in drawn


def test_want_of_memory_is_one_line(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    cold(monkeypatch, tmp_path)
    monkeypatch.setattr(compiling, "genetic_planner", killed)
    monkeypatch.setattr(compiling, "graph_searches", killed)
    answer = run("--jobs", 1)
    assert answer.exit_code == 2 and answer.output.endswith("try --jobs 1\n") and "Traceback" not in answer.output


def test_settings_add_what_they_choose(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    cold(monkeypatch, tmp_path)
    asked: list[Any] = []
    monkeypatch.setattr(compiling, "done_one_by_one", lambda jobs, after, processes: asked.extend(jobs) or [])
    file = tmp_path / "faster.toml"
    file.write_text('[guidance]\ncontroller = "motion-ga"\n')
    assert run("--settings", file).exit_code == 0
    assert asked[:4] == [genetic_planner, graph_searches, drive, manoeuvres]
    assert isinstance(asked[4], Chosen) and len(asked) == 5


def test_ctrl_c_is_not_for_the_processes_that_compile() -> None:
    """It is kept from them from their first moment on; the parent ends them, whatever they are at."""
    interrupted, endless = partial(signal.raise_signal, signal.SIGINT), partial(time.sleep, 600.0)
    jobs = done_one_by_one([interrupted, endless], {}, processes=2)
    since_s = time.monotonic()
    assert next(jobs) is interrupted
    jobs.close()  # type: ignore[attr-defined]
    assert time.monotonic() - since_s < 60.0 and signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())


def test_jobs_wait_for_those_whose_kernels_they_use() -> None:
    first, second, last = quick("first"), quick("second"), quick("last")
    order = list(done_one_by_one([last, second, first], {last: (second,), second: (first, drive)}, processes=2))
    assert order == [first, second, last]
    assert compiling._before(Chosen(Settings()), [drive, first], AFTER) == [drive, first]


def cold(monkeypatch: pytest.MonkeyPatch, place: Path) -> None:
    monkeypatch.setattr(compiling, "is_compiled", lambda settings: False)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(place))


def killed() -> None:
    os.kill(os.getpid(), signal.SIGKILL)
