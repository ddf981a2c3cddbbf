"""Writes the two screenshots of README: ``.venv/bin/python docs/make_screenshots.py``.

The live page while a simulated rover drives, and the report of the same drive with a decision and its why. The drive is
in lock-step with a fixed seed, so the pictures are about the same each time. It needs Debian's packages ``chromium``
and ``chromium-driver``, and the extra ``test``. It takes about a minute.
"""

from __future__ import annotations

import io
import os
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from companion.cli.kernel_cache import use_cache

ROOT = Path(__file__).parents[1]
IMAGES = ROOT / "docs" / "images"
MISSION, SEED = ROOT / "missions" / "depot.toml", 0
DRIVEN_M = 45.0
"""So far the rover has come on the live page."""
SPEEDUP = 3.0
"""Slow enough for a track without corners: the page is told five moments a second."""
SHOW_S, SETTLED_S = 0.2, 1.0
"""The figures of the page change twice a second."""
COLOURS, MOST_BYTES = 256, 200_000

if TYPE_CHECKING:
    from companion.viewer.live_viewer import LiveViewer
    from sitl.lockstep import Drive
    from tests.clients.browser import Page


def main() -> None:
    """Drives, and takes both pictures."""
    use_cache(os.environ)  # before numba is imported
    sys.path.append(str(ROOT))  # for the browser of the tests
    from tests.clients.browser import page

    with page() as shown, tempfile.TemporaryDirectory() as folder:
        _take_live(shown)
        report = Path(folder) / "report.html"
        _write_report(report)
        _take_report(shown, report)


def _take_live(shown: Page) -> None:
    from companion.mission.load import load_mission
    from companion.recording.recorder import NullRecorder
    from companion.settings import Settings
    from companion.viewer.live_viewer import LiveViewer
    from companion.viewer.web_process import WebPlace
    from sitl.lockstep import Drive
    from sitl.scenario import scenario_from_mission

    mission = load_mission(MISSION)
    run = Drive(mission, scenario_from_mission(mission), Settings(), SEED, NullRecorder())
    viewer = LiveViewer(WebPlace("127.0.0.1", 0), print)
    try:
        viewer.follow(run.companion, run.settings, simulated=True)
        shown.open(viewer.web.place.url)
        _drive(run, viewer)
        with _kept_fresh(run, viewer):
            shown.shows("Driving to", "GUIDED")
            time.sleep(SETTLED_S)
            _save(shown, "live-page")
    finally:
        viewer.close()


def _drive(run: Drive, viewer: LiveViewer) -> None:
    """Until the rover has come so far; in a multiple of real time once it moves."""
    from companion.core.clock import WallClock
    from sitl.cli.drive_progress import Pace

    pace = Pace(SPEEDUP, WallClock())
    while run.simulator.driven_m < DRIVEN_M and not run.companion.done:
        run.companion.tick()
        viewer.show(run.companion.status(), ())
        if run.simulator.driven_m > 0.0:
            pace.wait(run.simulator.time_s)


@contextmanager
def _kept_fresh(run: Drive, viewer: LiveViewer) -> Iterator[None]:
    """The drive stands still, and the page is told the same moment again and again: it would turn grey."""
    over, status = threading.Event(), run.companion.status()

    def show() -> None:
        while not over.wait(SHOW_S):
            viewer.show(status, ())

    thread = threading.Thread(target=show)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def _write_report(file: Path) -> None:
    from typer.testing import CliRunner

    from sitl.cli.commands import app

    result = CliRunner().invoke(app, ["drive", str(MISSION), "--seed", str(SEED), "--report", str(file)])
    if not file.exists():
        raise SystemExit(result.output)


def _take_report(shown: Page, file: Path) -> None:
    from tests.support.reports import report_data_in

    decision = max(report_data_in(file)["decisions"], key=_spread)
    shown.open(file.as_uri())
    shown.shows("record, simulated")
    shown.press("Decisions")
    slider = "const s = document.querySelector('input[type=range]'); s.value = arguments[0];"
    shown.run(slider + "s.dispatchEvent(new Event('input', {bubbles: true}))", decision["t"] + 0.01)
    shown.shows(f"Decision {decision['number']}", "candidate", "cost", "taken")
    time.sleep(SETTLED_S)
    _save(shown, "report")


def _spread(decision: dict[str, Any]) -> float:
    """How much the costs of the paths that were compared differ; 0 if one of them is not known."""
    costs = [one["cost"] for one in decision["candidates"]]
    return 0.0 if not costs or None in costs else float(max(costs) - min(costs))


def _save(shown: Page, name: str) -> None:
    from PIL import Image

    file = IMAGES / f"{name}.png"
    picture = Image.open(io.BytesIO(shown.driver.get_screenshot_as_png())).convert("RGB")
    picture.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(file, optimize=True)
    if file.stat().st_size > MOST_BYTES:
        raise SystemExit(f"{file}: {file.stat().st_size} bytes; that is too large for README")
    print(f"{file.relative_to(ROOT)} ({file.stat().st_size / 1e3:.0f} kB)")


if __name__ == "__main__":
    main()
