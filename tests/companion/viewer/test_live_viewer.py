"""The live viewer as a drive sees it: a fault in it is told once, and stops nothing."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from companion.cli.web import served, web_viewer
from companion.safety.reasons import EndReason
from companion.viewer.live_viewer import LiveViewer
from companion.viewer.web_process import WebError, WebPlace
from tests.companion.viewer.test_feed import new_drive
from tests.support.quick import first_of


@first_of(1, "time_s", [math.nan, math.inf])
def test_a_fault_of_the_picture_is_told_once_and_the_drive_goes_on(time_s: float) -> None:
    told: list[str] = []
    viewer, run = LiveViewer(WebPlace("127.0.0.1", 0), told.append), new_drive("points")
    try:
        viewer.follow(run.companion, run.settings, simulated=True)
        for _ in range(3):
            run.companion.tick()
            viewer.show(replace(run.take_status(), time_s=time_s))
    finally:
        viewer.close()
    assert len(told) == 1 and told[0].startswith("the page has no more news, the drive goes on: ")


def test_a_fault_at_the_end_is_told_and_keeps_nothing_from_being_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[str] = []
    viewer, run = LiveViewer(WebPlace("127.0.0.1", 0), told.append), new_drive("points")
    try:
        viewer.follow(run.companion, run.settings, simulated=True)
        monkeypatch.setattr(run.companion, "status", lambda: 1 / 0)
        viewer.end(EndReason.STOPPED_BY_USER)
        viewer.end(EndReason.STOPPED_BY_USER)
    finally:
        viewer.close()
    assert told == ["the page is not told how the run ended: ZeroDivisionError: division by zero"]


def test_only_a_person_is_told_the_token_with_the_address(tmp_path) -> None:
    viewer = web_viewer("0", tmp_path / "token", print)
    assert viewer is not None
    try:
        token = (tmp_path / "token").read_text().strip()
        place = viewer.web.place
        assert served(place, to_person=True).endswith(f"/#token={token}") and token not in served(
            place, to_person=False
        )
    finally:
        viewer.close()
    assert web_viewer(None, None, print) is None
    with pytest.raises(WebError, match="add --web PORT"):
        web_viewer(None, tmp_path / "token", print)
