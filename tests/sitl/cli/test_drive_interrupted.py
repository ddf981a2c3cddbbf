"""What the page is told when a drive is interrupted."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import cast

import pytest

from companion.core.interrupts import Terminated
from companion.safety.reasons import EndReason
from companion.viewer.live_viewer import LiveViewer
from sitl.cli.drive import _telling


@dataclass
class Page:
    """What it is told."""

    told: list[object] = field(default_factory=list)

    def end(self, reason: EndReason) -> None:
        self.told.append(reason)

    def fail(self, error: Exception) -> None:
        self.told.append(error)

    def close(self) -> None:
        self.told.append("closed")


def from_loop(interrupt: BaseException) -> SystemError:
    """What a compiled loop makes of it."""
    error = SystemError("returned a result with an exception set")
    error.__cause__ = interrupt
    return error


@pytest.mark.parametrize(
    ("interrupt", "reason"),
    [
        (KeyboardInterrupt(), EndReason.STOPPED_BY_USER),
        (from_loop(KeyboardInterrupt()), EndReason.STOPPED_BY_USER),
        (Terminated(), EndReason.TERMINATED),
        (from_loop(Terminated()), EndReason.TERMINATED),
    ],
)
def test_the_page_is_told_which_signal_has_ended_the_drive(interrupt: BaseException, reason: EndReason) -> None:
    page = Page()
    with pytest.raises(type(interrupt)), _telling(cast(LiveViewer, page)):
        raise interrupt
    assert page.told == [reason, "closed"]


def test_the_page_is_told_of_what_is_no_interrupt() -> None:
    page, error = Page(), ValueError()
    with pytest.raises(ValueError), _telling(cast(LiveViewer, page)):
        raise error
    assert page.told == [error, "closed"]
