"""What is told, and how often; the status as a terminal or a log file shows it."""

from __future__ import annotations

import io
import threading
from collections import deque
from types import SimpleNamespace
from typing import cast

import pytest
from rich.console import Console

from companion.cli import live as live_module
from companion.cli.live import MOST_WAITING, Live
from companion.core.severity import Severity
from companion.executive.mission_run import MissionRun
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mavlink.codec import Codec
from companion.mavlink.rates import RateFault
from companion.mavlink.transport import MemoryLink
from companion.operator.notifications import FAULT_AFTER_S, SAID_KEPT, News, Notifier, Status
from companion.safety.reasons import Activity, EndReason, Reason, RunPhase, WaitReason
from companion.settings import LinkSettings
from companion.storage.unbuffered import shared_with
from companion.vehicle.events import HeartbeatSeen
from companion.vehicle.state import VehicleState
from tests.support.notices import HandClock
from tests.support.served import wait_until
from tests.support.tlog import messages

SLOW = RateFault(32, 10.0, 1.0)
WAITING = Activity(RunPhase.WAITING, awaited=Reason(WaitReason.GUIDED))
DRIVING = Activity(RunPhase.DRIVING)


def notifier() -> tuple[Notifier, MemoryLink]:
    near, far = MemoryLink.pair()
    return Notifier(AutopilotLink(near, Codec(LinkSettings()), LinkSettings()), HandClock(), []), far


def test_nothing_is_told_twice_in_a_row_and_what_stays_so_once() -> None:
    one, far = notifier()
    for text in ("a", "a", "b", "a"):
        one.tell(text, Severity.INFO)
    assert one.said == [news.text for news in one.news] == ["a", "b", "a"]
    assert [(m.severity, m.text) for m in messages(far.read())] == [(6, "a"), (6, "b"), (6, "a")]
    for text in ("c", "c"):
        one.once(text)
    one.tell("b", Severity.INFO)
    one.once("c")
    assert one.said[3:] == ["c", "b"] and one.news[-2] == News(Severity.WARNING, "c")
    one.note("autopilot: d", Severity.ERROR)
    assert one.said[5:] == [] and one.news[-1] == News(Severity.ERROR, "autopilot: d", own=False)


def test_a_record_that_has_ended_is_told_before_the_mission_begins() -> None:
    one, _ = notifier()
    run = cast(MissionRun, SimpleNamespace(executor=None, vehicle=VehicleState()))
    for now_s in (1.0, 2.0):
        one.tell_faults(run, now_s, ("the record has ended",))
    assert one.said == ["the record has ended"]


def test_a_link_that_is_cut_and_comes_back_is_told_but_not_over_the_link() -> None:
    class Cable(MemoryLink):
        connected = True
        description = "serial:/dev/ttyACM0:115200"

    cable = Cable(deque(), deque())
    one = Notifier(AutopilotLink(cable, Codec(LinkSettings()), LinkSettings()), HandClock(), [])
    run = cast(MissionRun, SimpleNamespace(executor=None, vehicle=VehicleState()))
    cable.connected = False
    one.tell_faults(run, 1.0, ())
    assert one.news == [], "before the autopilot was heard the program says that it waits for it"
    run.vehicle = VehicleState(heartbeat=HeartbeatSeen(1.0, 4, armed=True, system_id=1))
    for now_s, cable.connected in ((2.0, False), (2.1, False), (2.2, True), (2.3, False), (2.4, True), (4.2, True)):
        one.tell_faults(run, now_s, ())
    assert len(one.news) == 1, "one that ends at once is not back"
    for now_s in (4.4, 4.5):
        one.tell_faults(run, now_s, ())
    assert [(news.severity, news.text.partition(":")[0], news.own) for news in one.news] == [
        (Severity.WARNING, "The link is cut", True), (Severity.INFO, "The link is back", True)
    ]  # fmt: skip
    assert one.said == []


def test_only_the_newest_texts_are_kept() -> None:
    one, _ = notifier()
    for number in range(SAID_KEPT + 5):
        one.tell(f"{number}", Severity.INFO)
    assert (len(one.said), one.said[0]) == (SAID_KEPT, "5")


def test_a_low_rate_is_told_once_and_only_when_it_lasts() -> None:
    one, _ = notifier()
    assert one.lasting_faults((SLOW,), (), 0.0) == []
    assert one.lasting_faults((), (), 3.0) == []
    assert one.lasting_faults((SLOW,), (), 4.0) == []
    assert one.lasting_faults((SLOW,), (), 4.0 + FAULT_AFTER_S) == [
        "LOCAL_POSITION_NED: 1.0 Hz instead of 10, asking again"
    ]
    assert one.lasting_faults((RateFault(32, 10.0, 2.0),), (), 30.0) == []
    assert one.lasting_faults((), ("the record has ended",), 31.0) == ["the record has ended"]
    assert one.lasting_faults((), ("the record has ended",), 32.0) == []


def status(activity: Activity, *news: str, target: str = "", time_s: float = 0.0) -> Status:
    told = tuple(News(Severity.INFO, text) for text in news)
    return Status(time_s, activity, None, None, target, 1, 2, 7, told)


def test_without_a_terminal_every_change_is_a_line() -> None:
    out = io.StringIO()
    with Live(Console(file=out), "Yard") as live:
        for seen in (
            status(WAITING),
            status(WAITING),
            status(DRIVING, "Heading for [gate]", target="gate"),
            status(DRIVING, target="gate"),
        ):
            live.show(seen)
    assert out.getvalue().splitlines() == [
        "Yard: waiting for GUIDED (asked for)",
        "Yard: Heading for [gate]",
        "Yard: driving: gate",
    ]


def test_on_a_terminal_one_line_changes_and_news_stay() -> None:
    out = io.StringIO()
    with Live(Console(file=out, force_terminal=True, width=100), "Yard") as live:
        live.show(status(DRIVING, "Heading for gate", target="gate", time_s=1.0))
        live.show(status(DRIVING, target="[b]", time_s=2.0))
        spinner = live._spinner
    assert "Yard: Heading for gate" in out.getvalue()
    assert spinner is not None and str(spinner.renderable.text) == "driving  [b] [1/2]  steps 7"


class FullDisk(io.StringIO):
    """Takes the first line and no more."""

    def write(self, text: str) -> int:
        if self.getvalue():
            raise OSError(28, "No space left on device")
        return super().write(text)


class Stuck(io.StringIO):
    """Takes nothing until it is let go."""

    def __init__(self) -> None:
        super().__init__()
        self.going = threading.Event()

    def write(self, text: str) -> int:
        self.going.wait(30.0)
        return super().write(text)


@pytest.mark.parametrize("is_terminal", [False, True])
def test_an_output_that_takes_nothing_holds_up_nothing(monkeypatch: pytest.MonkeyPatch, is_terminal: bool) -> None:
    out, dropped = Stuck(), []
    monkeypatch.setattr(live_module, "let_go", dropped.append)
    with Live(Console(file=out, force_terminal=is_terminal), "Yard") as live:
        live.unhurried(-0.4)
        for tick in range(2 * MOST_WAITING):
            live.show(status(DRIVING, f"news {tick}", target="gate", time_s=float(tick)))
        assert out.getvalue() == "" and dropped == []
    assert dropped == [shared_with(2, (1,))]
    out.going.set()
    live._worker._thread.join(10.0)


def test_what_a_slow_output_has_missed_is_told() -> None:
    out = Stuck()
    with Live(Console(file=out), "Yard") as live:
        for tick in range(2 * MOST_WAITING):
            live.show(status(DRIVING, f"news {tick}"))
        out.going.set()
        wait_until(lambda: f"news {MOST_WAITING - 2}" in out.getvalue())
        live.show(status(DRIVING, "the newest"))
    told = out.getvalue().splitlines()
    assert told[-1] == "Yard: the newest" and "outputs left out" in told[-2]


def test_a_full_disk_ends_the_show_and_not_the_run() -> None:
    out = FullDisk()
    with Live(Console(file=out), "Yard") as live:
        for activity in (Activity(RunPhase.CONNECTING), DRIVING, Activity(RunPhase.ENDED, Reason(EndReason.DONE))):
            live.show(status(activity))
    assert out.getvalue() == "Yard: connecting\n"
