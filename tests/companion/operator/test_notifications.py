"""What is said, and how often."""

from __future__ import annotations

import io

from rich.console import Console

from companion.cli.live import Live
from companion.mavlink.rates import RateFault
from companion.operator.reporting import FAULT_AFTER_S, News, Reporter, Status

SLOW = RateFault(32, 10.0, 1.0)


def test_nothing_is_said_twice_in_a_row() -> None:
    reporter = Reporter([])
    assert [reporter.say(text, 6) for text in ("a", "a", "b", "a")] == [True, False, True, True]
    assert reporter.said == [news.text for news in reporter.news] == ["a", "b", "a"]


def test_a_low_rate_is_told_once_and_only_when_it_lasts() -> None:
    reporter = Reporter([])
    assert reporter.faults((SLOW,), "", 0.0) == []
    assert reporter.faults((), "", 3.0) == []
    assert reporter.faults((SLOW,), "", 4.0) == []
    assert reporter.faults((SLOW,), "", 4.0 + FAULT_AFTER_S) == [
        "LOCAL_POSITION_NED: 1.0 Hz instead of 10, asking again"
    ]
    assert reporter.faults((RateFault(32, 10.0, 2.0),), "", 30.0) == []
    assert reporter.faults((), "the record has ended", 31.0) == ["the record has ended"]
    assert reporter.faults((), "the record has ended", 32.0) == []


def status(doing: str, *news: str, target: str = "", time_s: float = 0.0) -> Status:
    return Status(time_s, doing, None, None, target, 1, 2, 7, tuple(News(6, text) for text in news))


def test_without_a_terminal_every_change_is_a_line() -> None:
    out = io.StringIO()
    with Live(Console(file=out), "Yard") as live:
        for seen in (
            status("waiting for GUIDED"),
            status("waiting for GUIDED"),
            status("driving", "Heading for [gate]", target="gate"),
            status("driving", target="gate"),
        ):
            live.show(seen)
    assert out.getvalue().splitlines() == [
        "Yard: waiting for GUIDED",
        "Yard: Heading for [gate]",
        "Yard: driving: gate",
    ]


def test_on_a_terminal_one_line_changes_and_news_stay() -> None:
    out = io.StringIO()
    with Live(Console(file=out, force_terminal=True, width=100), "Yard") as live:
        live.show(status("driving", "Heading for gate", target="gate", time_s=1.0))
        live.show(status("driving", target="[b]", time_s=2.0))
        assert live._spinner is not None
        shown = live._spinner.renderable.text
    assert "Yard: Heading for gate" in out.getvalue()
    assert str(shown) == "driving  [b] [1/2]  steps 7"


class FullDisk(io.StringIO):
    """Takes the first line and no more."""

    def write(self, text: str) -> int:
        if self.getvalue():
            raise OSError(28, "No space left on device")
        return super().write(text)


def test_a_full_disk_ends_the_show_and_not_the_run() -> None:
    out = FullDisk()
    with Live(Console(file=out), "Yard") as live:
        for doing in ("connecting", "driving", "done"):
            live.show(status(doing))
    assert out.getvalue() == "Yard: connecting\n"
