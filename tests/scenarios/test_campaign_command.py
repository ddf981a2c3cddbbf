"""``rover-sitl campaign`` as a user starts it: on this machine, stopped and gone on with, and on a cluster."""

from __future__ import annotations

import json
import platform
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import psutil
import pytest
from typer.testing import CliRunner

from companion.core.extras import not_installed
from companion.recording.recorder import Recorder
from companion.safety.reasons import EndReason
from sitl.campaign.campaign_file import load_campaign
from sitl.campaign.run_spec import specs_of
from sitl.cli import compare
from sitl.cli.commands import app
from sitl.cli.runs import alone_in
from tests.sitl.network.test_server import free_port
from tests.support.rig import yard
from tests.support.served import finished, interpreter, mission_path, process, wait_until

CAMPAIGN = """
worlds = ["yard.toml"]
runs = 4
off_model = [0.0, 0.3]
time_limit_s = 49.0  # the autopilot's start-up takes 43 s
"""


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    assert mission_path(yard(tmp_path)).name == "yard.toml"
    file = tmp_path / "short.toml"
    file.write_text(CAMPAIGN)
    return file


def lines_of(folder: Path) -> list[dict[str, Any]]:
    file = folder / "runs.jsonl"
    return [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []


def results(folder: Path) -> dict[str, Any]:
    """By ID, without what depends on the machine."""
    return {line["id"]: {**line["result"], "cpu_s": 0.0} for line in lines_of(folder)}


@contextmanager
def dask(what: str, *arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    command = [sys.executable, "-m", f"distributed.cli.dask_{what}", *arguments]
    run = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield run
    finally:
        run.kill()
        run.wait()


@pytest.mark.thorough
@pytest.mark.slow
def test_the_processes_of_a_campaign_that_was_killed_end_too(campaign: Path) -> None:
    """They waited minutes for more work, with all that they had loaded."""
    campaign.write_text(CAMPAIGN.replace("runs = 4", "runs = 1000"))
    with interpreter("sitl", "campaign", campaign, "--jobs", "2", "--out", campaign.parent / "out") as run:
        wait_until(lambda: len(lines_of(campaign.parent / "out")) >= 2)
        children = psutil.Process(run.pid).children(recursive=True)
        run.kill()
    assert len(children) >= 2
    try:
        assert not psutil.wait_procs(children, timeout=30.0)[1]
    finally:
        for child in children:
            with suppress(psutil.NoSuchProcess):
                child.kill()


@pytest.mark.thorough
@pytest.mark.slow
def test_on_a_cluster_whose_worker_is_killed_the_figures_are_those_of_this_machine(campaign: Path) -> None:
    here, there = campaign.parent / "here", campaign.parent / "there"
    address = f"tcp://127.0.0.1:{free_port(socket.SOCK_STREAM)}"
    worker = (address, "--nthreads", "1", "--no-nanny", "--no-dashboard")
    with (
        dask("scheduler", "--host", "127.0.0.1", "--port", address.rpartition(":")[2], "--no-dashboard", "--no-show"),
        dask("worker", *worker) as killed,
        dask("worker", *worker),
        process("sitl", "campaign", campaign, "--cluster", address, "--out", there) as run,
    ):
        with process("sitl", "campaign", campaign, "--out", here) as alone:
            wait_until(lambda: len(lines_of(here)) >= 3)
            alone.send_signal(signal.SIGINT)
            code, _, err = finished(alone)
        assert code == 130 and "runs, kept in " in err and "Traceback" not in err
        assert "Not all runs are done" in (here / "report.html").read_text()
        wait_until(lambda: len(lines_of(there)) >= 2)
        killed.kill()
        code, out, err = finished(run)
    assert code == 0, err
    assert len(lines_of(there)) == 8 and len(results(there)) == 8, "nothing lost, nothing twice"
    assert results(here).items() <= results(there).items() and len(results(here)) >= 3
    assert "off_model" in out and (there / "report.html").stat().st_size > 10_000


@pytest.mark.thorough
@pytest.mark.slow
@pytest.mark.skipif(platform.machine() != "x86_64", reason="names of its units are those of x86-64")
def test_a_processor_without_wide_units_gives_the_same_figures(campaign: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As another machine might be: no vector units beyond the least, and no fused multiply-add. It compiles anew."""
    campaign.write_text(CAMPAIGN.replace("runs = 4", "runs = 1"))
    here, there = campaign.parent / "here", campaign.parent / "there"
    assert CliRunner().invoke(app, ["campaign", str(campaign), "--out", str(here)]).exit_code == 0
    for name, value in {
        "NUMBA_CPU_NAME": "generic",
        "NUMBA_CPU_FEATURES": "",
        "NUMBA_CACHE_DIR": str(campaign.parent / "kernels"),
        "NPY_DISABLE_CPU_FEATURES": " ".join(np.show_config(mode="dicts")["SIMD Extensions"]["found"]),
    }.items():
        monkeypatch.setenv(name, value)
    with interpreter("sitl", "campaign", campaign, "--out", there) as run:
        _, err = run.communicate(timeout=560)
    assert run.returncode == 0, err
    assert results(there) == results(here) and len(results(here)) == 2


@pytest.mark.thorough
def test_what_is_done_is_not_done_again_and_a_run_can_be_driven_again(
    campaign: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(campaign.parent)
    campaign.write_text(CAMPAIGN.replace("runs = 4", "runs = 1"))
    first = CliRunner().invoke(app, ["campaign", "short.toml", "--jobs", "2", "--parquet"])
    assert first.exit_code == 0, first.output
    (one, two) = lines_of(Path("out/short"))
    assert one["result"]["metres"] > 1.0 and one["result"] != two["result"]
    again = CliRunner().invoke(app, ["campaign", "short.toml"])
    assert "2 of 2 runs are there" in again.output and len(lines_of(Path("out/short"))) == 2
    single = CliRunner().invoke(app, ["campaign", "short.toml", "--replay", two["id"], "--record", "rec"])
    assert f"{two['result']['outcome']} after {two['result']['seconds']:.1f} s" in single.output
    assert Path("rec/link.tlog").stat().st_size > 10_000
    columns = Path("out/short/runs.csv").read_text().splitlines()[0].split(",")
    from pyarrow import parquet

    assert parquet.read_table("out/short/runs.parquet").column_names == columns


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["missing.toml"], "missing.toml: cannot be read"),
        (["short.toml", "--replay", "abc"], "--replay ID and --record FOLDER go together"),
        (["short.toml", "--budget", "5"], "--budget goes with --search"),
        (["short.toml", "--search", "stuck", "--cluster", "tcp://h:1"], "--search and --cluster do not go together"),
        (["short.toml", "--search", "stuck", "--parquet"], "--search and --parquet do not go together"),
        (["short.toml", "--search", "stuck", "--record", "r"], "--replay ID and --record FOLDER go together"),
        (["short.toml", "--search", "stuck", "--replay", "abc", "--record", "r"], "no run of the search in out/short/"),
        (
            ["short.toml", "--search", "stuck", "--budget", "9", "--replay", "abc", "--record", "r"],
            "--replay and --budget do not go together",
        ),
        (["short.toml", "--replay", "abc", "--record", "r", "--out", "o"], "--replay and --out go together with"),
        (["short.toml", "--cluster", "tcp://h:1", "--jobs", "2"], "--cluster and --jobs do not go together"),
        (["short.toml", "--replay", "abc", "--record", "r"], "no run of this campaign"),
        (["short.toml", "--out", "/proc/none"], "cannot be written"),
        (["short.toml", "--cluster", "tcp://127.0.0.1:1"], "nobody answers there"),
        (["short.toml", "--cluster", "tls://127.0.0.1:1"], "write tcp://HOST:PORT"),
    ],
)
def test_what_cannot_be_done_is_one_line(
    campaign: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], says: str
) -> None:
    monkeypatch.chdir(campaign.parent)
    result = CliRunner().invoke(app, ["campaign", *arguments])
    assert result.exit_code == 2 and says in result.output, result.output
    assert len(result.output.strip().splitlines()) == 1


def test_the_record_of_a_single_run_is_named_where_it_is_and_one_that_ended_early_is_told(
    campaign: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The folder that was asked for was named, also if the record had gone to another one."""
    report = SimpleNamespace(outcome="reached", driving_time_s=1.0, collisions=0)
    drive = SimpleNamespace(run=lambda *_: report, ended_by=lambda reason: reason)
    monkeypatch.setattr("sitl.cli.campaign.prepared", lambda *_: drive)
    monkeypatch.chdir(campaign.parent)
    run_id = next(iter(specs_of(load_campaign(campaign)))).id
    command = ["campaign", "short.toml", "--replay", run_id, "--record", "rec"]
    assert "record: rec; " in CliRunner().invoke(app, command).output
    second = CliRunner().invoke(app, command)
    assert second.exit_code == 0 and "record: rec-2; rover-companion report rec-2 shows it" in second.output

    class FullDisk(Recorder):
        def close(self, *, ended_by: EndReason | None = None) -> None:
            super().close(ended_by=ended_by)
            self.problem = "rec-3: the record has ended: No space left on device"

    monkeypatch.setattr("sitl.cli.campaign.Recorder", FullDisk)
    full = CliRunner().invoke(app, command)
    assert full.exit_code == 2 and full.output.endswith("the record has ended: No space left on device\n")


@pytest.mark.thorough
def test_planners_side_by_side_are_a_campaign_with_a_plot(campaign: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(campaign.parent)
    result = CliRunner().invoke(app, ["compare", "yard.toml", "--planners", "astar, dijkstra", "--seeds", "1"])
    assert result.exit_code == 0, result.output
    assert "dijkstra / astar" in result.output
    assert Path("out/compare/times.png").read_bytes().startswith(b"\x89PNG")
    assert [line["run"]["planner"] for line in lines_of(Path("out/compare"))] == ["astar", "dijkstra"]
    kept = Path("out/compare/campaign.toml").read_text(encoding="utf-8")
    for arguments, says in (
        (("yard.toml", "--planners", "astr"), "--planners: unknown planner 'astr'"),
        (("yard.toml", "--planners", " , "), "--planners ' , ': names nothing"),
        (("no.toml", "--planners", "astar"), "no.toml: no such mission file"),
    ):
        bad = CliRunner().invoke(app, ["compare", *arguments])
        assert bad.exit_code == 2 and bad.output.startswith(says) and len(bad.output.splitlines()) == 1
    assert Path("out/compare/campaign.toml").read_text(encoding="utf-8") == kept, "the old report's commands still work"


def test_ground_in_words_is_compared_like_a_mission(campaign: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Words that end in ``.6`` were taken for the name of a file."""
    monkeypatch.chdir(campaign.parent)
    driven: list[Path] = []
    monkeypatch.setattr(compare, "drive_campaign", lambda file, out, jobs: driven.append(file) or [])
    words = "rooms movers=2 least_door_m=1.6"
    result = CliRunner().invoke(app, ["compare", words, "yard.toml", "--planners", "astar", "--seeds", "1"])
    assert result.exit_code == 0 and load_campaign(driven[0]).worlds == [words, "../../yard.toml"], result.output


def test_two_comparisons_in_one_folder_are_one_line_and_change_nothing(
    campaign: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second had written its campaign over that of the first, whose report then named runs that were not in it."""
    monkeypatch.chdir(campaign.parent)
    kept = Path("out/compare/campaign.toml")
    kept.parent.mkdir(parents=True)
    kept.write_text("of the first")
    with alone_in(kept.parent):
        second = CliRunner().invoke(app, ["compare", "yard.toml", "--planners", "astar", "--seeds", "1"])
    assert second.exit_code == 2 and "another campaign writes its runs here" in second.output, second.output
    assert len(second.output.splitlines()) == 1 and kept.read_text() == "of the first"


GLASS = 'size_m = [20.0, 10.0]\n[[obstacle]]\nline_m = [[0.0, 8.0], [10.0, 8.0]]\nwidth_m = 0.3\nmaterial = "glass"\n'
BEHIND = '[[target]]\nnorth_m = 0.0\neast_m = 12.0\n[sitl]\nworld = "glass.toml"\nstart = [5, 5]\nheading_deg = 90.0\n'


@pytest.mark.thorough
def test_a_search_finds_makes_small_and_writes_what_drives_the_same_again(tmp_path: Path) -> None:
    """A pane of glass that no sensor sees stands in the way: nothing needs to differ from the usual."""
    (tmp_path / "glass.toml").write_text(GLASS)
    (tmp_path / "behind.toml").write_text(BEHIND)
    file, out = tmp_path / "panes.toml", tmp_path / "out"
    file.write_text('worlds = ["behind.toml"]\ntime_limit_s = 52.0\n[search]\nparts = ["rover"]\n')
    command = ["campaign", str(file), "--search", "collision", "--budget", "4", "--out", str(out)]
    result = CliRunner().invoke(app, command, env={"COLUMNS": "200"})
    assert result.exit_code == 0, result.output
    (found,) = (out / "search-collision" / "found").glob("collision-*.toml")
    told = result.stdout.splitlines()
    assert told[-5].startswith("collision: behind.toml, seed 0, points: collision, touched")
    assert told[-4] == "  differs: nothing"
    run_id = found.stem[-12:]
    assert told[-3] == f"  again: rover-sitl campaign {found} --replay {run_id} --record out/{run_id}"
    assert told[-1].endswith(" of 1 kind")
    number = len(lines_of(out / "search-collision"))

    again = CliRunner().invoke(app, command, env={"COLUMNS": "200"})
    assert again.stdout.splitlines()[-5:] == told[-5:], "the same search"
    assert len(lines_of(out / "search-collision")) == number, "nothing is driven twice"

    replayed = CliRunner().invoke(
        app, ["campaign", str(found), "--replay", found.stem[-12:], "--record", str(tmp_path / "run")]
    )
    assert replayed.exit_code == 0 and "1 contacts" in replayed.output, replayed.output


def test_a_search_without_the_optimiser_is_one_line(campaign: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cma", None)
    command = ["campaign", str(campaign), "--search", "stuck", "--out", str(campaign.parent / "out")]
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 2
    assert result.output.splitlines()[-1] == not_installed("--search", "search", "cma")


def test_a_table_that_cannot_be_written_is_told_before_hours_of_driving(
    campaign: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    result = CliRunner().invoke(app, ["campaign", str(campaign), "--parquet", "--out", str(campaign.parent / "out")])
    assert result.exit_code == 2 and not list(campaign.parent.rglob("runs.jsonl")), result.output
    assert result.output.startswith("--parquet: pyarrow is not installed; install it: pip install 'rover-")


@pytest.mark.parametrize("command", ["campaign", "compare", "experiment gates"])
def test_without_the_library_of_its_statistics_nothing_is_driven(
    campaign: Path, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    """The table came after hours of drives, and ended in a traceback."""
    monkeypatch.setitem(sys.modules, "scipy", None)
    monkeypatch.chdir(campaign.parent)
    given = {
        "campaign": [str(campaign)],
        "compare": ["clutter", "--planners", "hybrid,theta-star", "--seeds", "1"],
        "experiment gates": ["--runs", "1"],
    }
    result = CliRunner().invoke(app, [*command.split(), *given[command]])
    assert result.exit_code == 2 and not list(campaign.parent.rglob("runs.jsonl")), result.output
    assert result.output.splitlines()[-1].endswith(not_installed("its statistics", "experiments", "scipy"))
