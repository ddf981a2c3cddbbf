"""``rover-sitl campaign``: drives every run of a campaign file, keeps each, and sums up."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from companion.cli.entry import StoppedError
from companion.cli.inputs import EXIT_BAD_INPUT, OutputError, writable, written
from companion.core.interrupts import is_interrupt
from companion.mapping.map_files import MapError
from companion.mission.mission import MissionError
from companion.recording.record_format import RecordError
from companion.recording.recorder import Recorder
from companion.safety.reasons import EndReason
from sitl.campaign.campaign_file import CampaignError, load_campaign
from sitl.campaign.drive_run import driven, mission_of, prepared, settings_of
from sitl.campaign.page_parts import number_of
from sitl.campaign.policies import ERROR
from sitl.campaign.replay_server import ReplayServer, ServeError
from sitl.campaign.run_spec import RunSpec, specs_of
from sitl.campaign.run_store import Digests, RunStore, kept_run
from sitl.campaign.summary import Runs
from sitl.campaign.workers import Done, driven_here, driven_on
from sitl.cli.campaign_outputs import PARQUET, REPORT, put_out
from sitl.cli.extras import parquet_fault, statistics_fault
from sitl.cli.runs import FILE, alone_in, check_all, progress, say_what_there_is, warm_up_all
from sitl.cli.search import place_of_search, search_campaign
from sitl.cli.serve_report import replay_of, serve_report
from sitl.generators.made_ground import NoWayError
from sitl.scenario import ScenarioError
from sitl.search.goals import Goal

BAD_INPUT = (
    CampaignError, MissionError, MapError, ScenarioError, OutputError, RecordError, NoWayError, ServeError,
)  # fmt: skip
EXIT_FAILED = 3
BUDGET = 1000
APART = {
    "--search": ("--cluster", "--parquet"),
    "--replay": ("--cluster", "--parquet", "--jobs", "--budget", "--serve"),
    "--cluster": ("--jobs",),
}
"""Options that do not go together."""


def campaign(
    file: Annotated[Path, typer.Argument(metavar="CAMPAIGN", help="TOML file: docs/campaigns.md describes it.")],
    out: Annotated[
        Path | None,
        typer.Option(help="Folder of the results; default: out/NAME. What is done there is not done again."),
    ] = None,
    jobs: Annotated[int, typer.Option(min=1, help="Processes of this machine (needs joblib).")] = 1,
    cluster: Annotated[
        str | None,
        typer.Option(metavar="tcp://HOST:PORT", help="A dask scheduler whose workers drive (needs the extra cluster)."),
    ] = None,
    replay: Annotated[
        str | None,
        typer.Option(
            metavar="ID",
            help="Drive this single run again, with a record; ID as in the report. With --search: of the search.",
        ),
    ] = None,
    record: Annotated[Path | None, typer.Option(help="With --replay: the folder of the record.")] = None,
    search: Annotated[
        Goal | None,
        typer.Option(
            metavar="GOAL",
            help=f"Look for runs that do this, instead of driving the lists (needs cma): {', '.join(Goal)}.",
        ),
    ] = None,
    budget: Annotated[
        int | None,
        typer.Option(
            min=1, help="With --search: so many runs; those that make finds small come on top. Default: 1000."
        ),
    ] = None,
    parquet: Annotated[
        bool, typer.Option("--parquet", help=f"Write {PARQUET}, too (needs the extra parquet).")
    ] = False,
    serve: Annotated[
        int | None,
        typer.Option(
            metavar="PORT",
            min=1,
            max=65535,
            help="Then serve the report on this machine, with a link at each run that drives it again and shows it, "
            "until Ctrl-C.",
        ),
    ] = None,
) -> None:
    """Drive every run of CAMPAIGN: worlds x planners x controllers x sensors x faults x settings x seeds.

    Exit code 2: bad input; 3: a run ended with an error of the programs; 130: stopped, what is done is kept
    and reported (not while the report is served).
    """
    try:
        _check_together(
            {
                "--search": search is not None,
                "--budget": budget is not None,
                "--cluster": cluster is not None,
                "--replay": replay is not None,
                "--record": record is not None,
                "--parquet": parquet,
                "--jobs": jobs > 1,
                "--out": out is not None,
                "--serve": serve is not None,
            }
        )
        server = None if serve is None else _server(serve)
        if replay is not None or record is not None:
            _drive_again(file, replay, record, search, out)
        elif search is not None:
            search_campaign(file, search, budget or BUDGET, out, jobs, server)
        else:
            drive_campaign(file, out, jobs, cluster, parquet=parquet, server=server)
    except BAD_INPUT as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error


def _server(port: int) -> ReplayServer:
    """Raises ServeError."""
    server = ReplayServer(port)
    typer.echo(f"--serve: {server.url} answers when all runs are done", err=True)
    return server


def _check_together(given: Mapping[str, bool]) -> None:
    """Raises CampaignError for options of which one would be without effect."""
    if given["--budget"] and not given["--search"]:
        raise CampaignError("--budget goes with --search")
    if given["--replay"] and given["--out"] and not given["--search"]:
        raise CampaignError("--replay and --out go together with --search alone; leave --out out")
    for one, others in APART.items():
        for other in others:
            if given[one] and given[other]:
                raise CampaignError(f"{one} and {other} do not go together; leave one of them out")


def drive_campaign(
    file: Path,
    out: Path | None,
    jobs: int,
    cluster: str | None = None,
    *,
    parquet: bool = False,
    server: ReplayServer | None = None,
) -> Runs:
    """Drive what is left of a campaign, put everything out, and serve it. Raises one of ``BAD_INPUT``.

    When it is stopped, what is done is put out; then StoppedError.
    """
    if fault := statistics_fault("campaign") or (parquet_fault() if parquet else ""):
        raise CampaignError(fault)
    console = Console()
    table, folder = load_campaign(file), file.resolve().parent
    place = out or Path("out") / table.name
    writable(place / FILE)
    with alone_in(place):
        digests = Digests(folder)
        store = RunStore(place / FILE, digests.of)
        specs = list(specs_of(table))
        done = len(store.of(specs))
        say_what_there_is(store, f"{done} of {len(specs)} runs" if done else "")
        left = [spec for spec in specs if spec.id not in store.results]
        stopped: StoppedError | None = None
        if left:
            check_all(left, folder)
            try:
                _drive(console, left, done, store, digests, jobs, cluster)
            except StoppedError as error:
                stopped = error
        runs = store.of(specs)
        if runs:
            put_out(console, table, runs, file, place, parquet=parquet)
    if stopped is not None:
        raise stopped
    if server is not None:
        commands = {spec: ("campaign", str(file), "--replay", spec.id) for spec, _ in runs}
        serve_report(server, place, [replay_of(spec, digests, command) for spec, command in commands.items()])
    errors = sum(result.outcome == ERROR for _, result in runs)
    if errors:
        ended = f"{number_of(errors, 'run')} ended with an error"
        typer.echo(f"{table.name}: {ended}; {place / REPORT} says which", err=True)
        raise typer.Exit(EXIT_FAILED)
    return runs


def _drive(
    console: Console,
    left: list[RunSpec],
    before: int,
    store: RunStore,
    digests: Digests,
    jobs: int,
    cluster: str | None,
) -> None:
    """All that is left; ``before`` are done. Ctrl-C ends it with StoppedError; what is done is kept."""
    if cluster is None:
        warm_up_all(left, digests.folder)
    total, others = before + len(left), len(store.results) - before
    done: Done = driven_here(left, digests, jobs) if cluster is None else driven_on(left, digests, cluster)
    try:
        with progress(console, total, before) as advance:
            for spec, result in done:
                with written(store.file):
                    store.add(spec, result)
                advance(1)
    except KeyboardInterrupt:
        kept = f"{len(store.results) - others} of {number_of(total, 'run')}"
        raise StoppedError(f"{kept}, kept in {store.file}; the same command goes on") from None


def _spec_of(file: Path, run_id: str, goal: Goal | None, out: Path | None) -> RunSpec:
    """The run of the campaign, or of a search. Raises CampaignError for an ID that it does not have."""
    table = load_campaign(file)
    if goal is None:
        spec, where = next((spec for spec in specs_of(table) if spec.id == run_id), None), "this campaign"
    else:
        kept = place_of_search(table, goal, out) / FILE
        spec, where = kept_run(kept, run_id), f"the search in {kept}"
    if spec is None:
        raise CampaignError(f"{file}: --replay {run_id:.40}: no run of {where}; the report names them")
    return spec


def _drive_again(file: Path, run_id: str | None, record: Path | None, goal: Goal | None, out: Path | None) -> None:
    """One run with a record. Raises one of ``BAD_INPUT``."""
    folder = file.resolve().parent
    if run_id is None or record is None:
        raise CampaignError(f"{file}: --replay ID and --record FOLDER go together")
    spec = _spec_of(file, run_id, goal, out)
    writable(record / "meta.json")
    mission, settings = mission_of(spec, folder), settings_of(spec)
    recorder = Recorder(record, mission, settings, spec.seed, arm=True, start_us=0)
    ended_by: EndReason | None = None
    try:
        drive = prepared(spec, folder, recorder)
        report, _ = driven(drive, spec)
        ended_by = drive.ended_by(EndReason.TIME_LIMIT)
    except Exception as error:
        if is_interrupt(error):
            raise
        what = " ".join(f"{type(error).__name__}: {error}".split())
        raise CampaignError(f"{spec.world}, seed {spec.seed}: the run ended with an error: {what:.300}") from error
    finally:
        recorder.close(ended_by=ended_by)
    contacts = f", {report.collisions} contacts" if report.collisions else ""
    typer.echo(f"{spec.world}, seed {spec.seed}: {report.outcome} after {report.driving_time_s:.1f} s{contacts}")
    if recorder.problem:
        raise OutputError(recorder.problem)
    place = recorder.directory  # another one than was asked for, if that has a record already
    typer.echo(f"record: {place}; rover-companion report {place} shows it")
