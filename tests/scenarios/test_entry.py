"""How the scripts begin and end: wrong usage and an interrupt during the imports."""

import ctypes
import json
import os
import signal
import subprocess
import sys
import time
from functools import partial
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
import typer
from PIL import Image
from typer.testing import CliRunner

from companion.cli.commands import app as companion_commands
from companion.cli.entry import StoppedError, start
from companion.core.interrupts import Terminated
from companion.recording.reader import load_record
from companion.safety.reasons import EndReason
from sitl.cli.commands import app as sitl_commands
from tests.support.forked import Forked, run
from tests.support.quick import first_of
from tests.support.served import PATIENCE_S, finished, process, slowness

SCRIPTS = {"rover-companion": "companion", "rover-sitl": "sitl"}


def command(name: str, *arguments: str) -> list[str]:
    return [sys.executable, "-c", f"from {SCRIPTS[name]}.cli.main import main; main()", *arguments]


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        (("rover-sitl", "drive", "--seed", "-1"), "'--seed'"),
        (("rover-sitl", "drive", "missions/field.plan", "--resolution-m", "0"), "'--resolution-m'"),
        (("rover-sitl", "drive", "missions/field.plan", "--resolution-m", "nan"), "'--resolution-m'"),
        (("rover-sitl", "drive", "missions/field.plan", "--resolution-m", "0,5"), "'0,5'"),
        (("rover-sitl", "campaign", "c.toml", "--search", "colision"), "'--search': 'colision' is not one of"),
        (("rover-sitl", "fly"), "No such command 'fly'"),
        (("rover-sitl",), "Missing command"),
        (("rover-companion", "run", "missions/open.toml"), "Missing option '--connect'"),
        (("rover-sitl", "drive", "missions/open.toml", "--sensors", "none"), "does not drive without range data"),
        (
            ("rover-sitl", "drive", "missions/open.toml", "--image", "open.doc"),
            "open.doc: suffix '.doc' is no picture format; known: .png, ",
        ),
        (
            ("rover-sitl", "drive", "missions/open.toml", "--image", "missions"),
            "missions: is a folder, not a file; add a file's name, like missions/picture.png",
        ),
    ],
)
def test_wrong_usage_gets_one_line_and_exit_code_2(arguments: tuple[str, ...], what: str) -> None:
    name, *rest = arguments
    code, out, err = run(SCRIPTS[name], *rest)
    assert (code, out) == (2, "")
    assert err.count("\n") == 1 and what in err and "Input should" not in err


def test_sigterm_ends_a_command_like_an_interrupt(capsys: pytest.CaptureFixture[str]) -> None:
    raised: list[type[BaseException]] = []

    def load() -> typer.Typer:
        try:
            signal.raise_signal(signal.SIGTERM)
        except KeyboardInterrupt as interrupt:
            raised.append(type(interrupt))
            raise
        raise AssertionError("the signal has been passed over")

    before = signal.getsignal(signal.SIGTERM)
    assert start("rover-companion", load) == 130
    assert raised == [Terminated]
    assert capsys.readouterr().err == "rover-companion: stopped by SIGTERM\n"
    assert signal.getsignal(signal.SIGTERM) == before


def test_an_interrupt_while_it_loads_is_no_traceback() -> None:
    quiet = 0
    for name, delay_s in (("rover-companion", 0.15), ("rover-sitl", 0.3), ("rover-companion", 0.45)):
        arguments = command(name, "--help")
        with subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            time.sleep(delay_s * slowness())
            process.send_signal(signal.SIGINT)
            _, errors = process.communicate(timeout=PATIENCE_S)
        # Before our first line runs, the interpreter itself may still be starting: that is not ours.
        quiet += "cli/" not in errors and process.returncode in (0, 130)
    assert quiet >= 1


def test_an_interrupt_of_a_command_that_says_nothing_itself_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    """typer ends a command with the code of an interrupt and no word."""
    app = typer.Typer()

    @app.command()
    def interrupted() -> None:
        raise KeyboardInterrupt

    @app.command()
    def talkative() -> None:
        raise StoppedError("half of it is done")

    code = start("script", lambda: partial(app, ["interrupted"]))
    assert (code, capsys.readouterr().err) == (130, "script: stopped by Ctrl-C\n")
    code = start("script", lambda: partial(app, ["talkative"]))
    assert (code, capsys.readouterr().err) == (130, "stopped by Ctrl-C: half of it is done\n")


def test_an_interrupt_inside_a_compiled_loop_ends_a_command_like_any_other(capsys: pytest.CaptureFixture[str]) -> None:
    """What numba makes of it; other errors of that kind stay what they are."""
    app = typer.Typer()

    @app.command()
    def interrupted() -> None:
        first = SystemError("returned a result with an exception set")
        first.__cause__ = KeyboardInterrupt()
        raise SystemError("a loop that called the first one") from first

    @app.command()
    def broken() -> None:
        raise SystemError("bad call")

    assert start("script", lambda: partial(app, ["interrupted"])) == 130
    assert capsys.readouterr().err == "script: stopped by Ctrl-C\n"
    with pytest.raises(SystemError, match="bad call"):
        start("script", lambda: partial(app, ["broken"]))


@pytest.mark.parametrize(("interrupt", "word"), [(KeyboardInterrupt, "Ctrl-C"), (Terminated, "SIGTERM")])
@pytest.mark.parametrize("fails", [False, True])
def test_an_interrupt_in_a_callback_from_c_ends_a_command_like_any_other(
    capsys: pytest.CaptureFixture[str], interrupt: type[KeyboardInterrupt], word: str, fails: bool
) -> None:
    """The compiler calls back when a kernel is made. Without what it was to do there, it may fail."""
    app, reached = typer.Typer(), []

    def interrupted() -> None:
        if interrupt is Terminated:
            signal.raise_signal(signal.SIGTERM)
        raise KeyboardInterrupt

    @app.command()
    def compiles() -> None:
        ctypes.CFUNCTYPE(None)(interrupted)()
        if fails:
            raise RuntimeError("no compiled object yet")
        reached.append(str(fails))

    before = sys.unraisablehook
    assert start("script", lambda: partial(app, [])) == 130
    assert (capsys.readouterr().err, reached) == (f"script: stopped by {word}\n", [])
    assert sys.unraisablehook is before and sys.getprofile() is None


def test_other_errors_in_a_callback_from_c_are_told_as_before(monkeypatch: pytest.MonkeyPatch) -> None:
    app, told = typer.Typer(), list[type[BaseException]]()
    monkeypatch.setattr(sys, "unraisablehook", lambda what: told.append(what.exc_type))

    def broken() -> None:
        raise ValueError

    @app.command()
    def compiles() -> None:
        ctypes.CFUNCTYPE(None)(broken)()

    assert start("script", lambda: partial(app, [])) == 0
    assert told == [ValueError]


def test_ctrl_c_in_the_middle_of_a_compiled_search_is_one_line(tmp_path: Path) -> None:
    """A real one: a large map of passages to and fro, whose search lasts far longer than the signal needs to arrive."""
    pixels = np.full((1500, 1500), 255, dtype=np.uint8)
    pixels[:, 4::4] = 0
    pixels[0, 4::8] = pixels[-1, 8::8] = 255
    Image.fromarray(pixels).save(tmp_path / "passages.png")
    # It says when it begins: before that, an interrupt meets no compiled loop.
    said = """
import companion.cli.plan as plan
budget_of = plan.budget_of
plan.budget_of = lambda effort: print("searches", flush=True) or budget_of(effort)
"""
    ends = ("--start", "0,0", "--target", "1498,700", "--planner", "dijkstra")
    with Forked("companion", ["plan", tmp_path / "passages.png", *ends], first=said) as child:
        assert child.stdout.readline() == "searches\n"
        time.sleep(0.05)
        child.send_signal(signal.SIGINT)
        out, errors = child.communicate(timeout=PATIENCE_S)
    assert (child.returncode, out, errors) == (130, "", "rover-companion: stopped by Ctrl-C\n")


@pytest.mark.parametrize(
    ("interrupt", "reason"), [(KeyboardInterrupt, EndReason.STOPPED_BY_USER), (Terminated, EndReason.TERMINATED)]
)
def test_a_drive_interrupted_in_a_compiled_loop_keeps_its_record_all_the_same(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    interrupt: type[KeyboardInterrupt],
    reason: EndReason,
) -> None:
    def interrupted(*arguments: object, **options: object) -> None:
        raise SystemError("returned a result with an exception set") from interrupt()

    monkeypatch.setattr("sitl.cli.drive.Drive", interrupted)
    record = tmp_path / "record"
    drive = ["drive", "missions/open.toml", "--record", str(record)]
    assert start("rover-sitl", lambda: partial(sitl_commands, drive)) == 130
    assert capsys.readouterr().err.endswith(f"rover-companion report {record} shows it\n")
    assert json.loads((record / "meta.json").read_text())["ended_by"] == reason.name


@pytest.mark.parametrize("name", SCRIPTS)
def test_the_version_is_told(name: str) -> None:
    done = subprocess.run(command(name, "--version"), capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, f"{name} {version('rover-companion')}\n", "")


@first_of(1, ("number", "word"), [(signal.SIGINT, "Ctrl-C"), (signal.SIGTERM, "SIGTERM")])
def test_an_interrupted_drive_says_what_was_stopped_and_where_its_record_and_report_are(
    tmp_path: Path, number: signal.Signals, word: str
) -> None:
    record, report = tmp_path / "record", tmp_path / "report.html"
    command = ("drive", "missions/rooms.toml", "--sensors", "beams", "--record", record, "--report", report)
    # A shell's job in the background would ignore Ctrl-C, and all that it starts.
    heeded = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
    with process("sitl", *command, first=heeded) as child:
        assert any("Heading for" in line for line in child.stdout)
        child.send_signal(number)
        code, _, errors = finished(child)
    assert code == 130 and errors.count("\n") == 1
    assert errors.startswith(f"stopped by {word}: Rooms after ") and "0 of 1 targets reached" in errors
    assert f"; report: {report} (" in errors and report.read_text().endswith("</html>\n")
    assert errors.endswith(f"; record so far: {record}; rover-companion report {record} shows it\n")
    why = EndReason.STOPPED_BY_USER if number is signal.SIGINT else EndReason.TERMINATED
    assert load_record(record).meta.end_reason is why
    assert all((record / name).stat().st_size > 0 for name in ("link.tlog", "map.yaml", "map.pgm"))


@first_of(1, ("name", "words"), [("rover-companion", "--from-autopilot"), ("rover-sitl", "--time-limit-s")])
def test_on_a_narrow_terminal_no_option_is_cut(name: str, words: str) -> None:
    which = "run" if name == "rover-companion" else "drive"
    narrow = {**os.environ, "COLUMNS": "60"}
    done = subprocess.run(command(name, which, "--help"), capture_output=True, text=True, env=narrow, check=True)
    assert words in done.stdout and "…" not in done.stdout
    assert max(map(len, done.stdout.splitlines())) <= 60


@pytest.mark.parametrize("commands", [companion_commands, sitl_commands])
def test_no_page_of_help_is_wider_than_a_narrow_terminal(
    commands: typer.Typer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    for name in typer.main.get_group(commands).commands:
        told = CliRunner().invoke(commands, [name, "--help"], terminal_width=60)
        assert told.exit_code == 0 and "…" not in told.output, name
        assert max(map(len, told.output.splitlines())) <= 60, name
        assert "\\[" not in told.output, name
