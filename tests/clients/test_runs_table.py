"""The report's table of runs in a browser: filtered and sorted, plain without a script, and with links to its runs."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from sitl.campaign.campaign_file import CampaignTable
from sitl.campaign.page_parts import document
from sitl.campaign.run_spec import RunResult, specs_of
from sitl.campaign.runs_table import runs_table
from tests.clients.browser import Page, needs_browser, page
from tests.clients.program import ours
from tests.sitl.network.test_server import free_port

pytestmark = [needs_browser, pytest.mark.thorough]

TABLE = CampaignTable(name="a", worlds=["clutter", "rooms"], runs=15, controllers=["points", "motion-ga"])
RESULT = RunResult("points", "reached", 1, 1, said="done")
SHOWN = "return [...document.querySelectorAll('#runs tbody tr')].filter((row) => row.offsetParent)"
CHOOSE = (
    "const label = [...document.querySelectorAll('#filter label')].find((one) => one.textContent.startsWith("
    "arguments[0])); const select = label.querySelector('select');"
    "select.value = [...select.options].find((one) => one.text === arguments[1]).value;"
    "select.dispatchEvent(new Event('input', { bubbles: true }))"
)


@pytest.fixture
def report(tmp_path: Path) -> Iterator[Page]:
    runs = [
        (spec, replace(RESULT, seconds=8.5 + spec.seed, touched=int(spec.world == "rooms" and spec.seed == 2)))
        for spec in specs_of(TABLE)
    ]
    file = tmp_path / "report.html"
    file.write_text(document("a", [runs_table(TABLE, runs, Path("points.toml"))]), encoding="utf-8")
    with page() as shown:
        shown.open(file.as_uri())
        yield shown
        assert shown.faults == []


def column(report: Page, number: int) -> list[str]:
    return [str(one) for one in report.run(f"{SHOWN}.map((row) => row.cells[{number}].textContent)")]


def test_rows_are_filtered_and_sorted(report: Page) -> None:
    report.shows("60 of 60 rows")
    assert column(report, 3)[:3] == ["contact", "contact", ""], "what went wrong comes first"
    report.run(CHOOSE, "controller", "points")
    assert column(report, 1) == ["points"] * 30
    report.run(CHOOSE, "broke", "contact")
    report.shows("1 of 60 rows")
    assert column(report, 0) == ["rooms"]
    report.run(CHOOSE, "broke", "all")
    report.run(
        "const words = document.querySelector('#filter input'); words.value = 'Clutter points';"
        "words.dispatchEvent(new Event('input', { bubbles: true }))"
    )
    assert column(report, 0) == ["clutter"] * 15
    report.click("#runs th:nth-child(9)")
    assert column(report, 8)[:3] == ["8.5", "9.5", "10.5"], "as numbers"
    report.click("#runs th:nth-child(9)")
    assert column(report, 8)[0] == "22.5"


def test_a_click_on_a_seed_drives_the_run_again_and_shows_it(tmp_path: Path) -> None:
    file, port = tmp_path / "short.toml", free_port()
    file.write_text('worlds = ["clutter target_east_m=8"]\nruns = 1\ntime_limit_s = 120.0\n')
    with (
        ours(tmp_path, "sitl", "campaign", file, "--out", tmp_path / "out", "--serve", port) as served,
        page() as shown,
    ):
        served.says(f"served at http://127.0.0.1:{port}/")
        shown.open((tmp_path / "out" / "report.html").as_uri())
        assert "A click on a seed" not in shown.text, "nobody would answer"
        shown.open(f"http://127.0.0.1:{port}/")
        shown.shows("A click on a seed")
        shown.click("#runs a.replay")
        shown.until(lambda: len(shown.driver.window_handles) == 2)
        shown.driver.switch_to.window(shown.driver.window_handles[-1])
        shown.shows("1 of 1 targets reached", "record, simulated")
        assert served.end(signal.SIGINT) == 0
