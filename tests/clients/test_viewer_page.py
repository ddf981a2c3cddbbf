"""The viewer in a real browser: live beside a driving companion, after a killed web process, and as a report."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.clients.browser import DESKTOP, PHONE, Page, needs_browser, page
from tests.clients.program import Program, ours
from tests.sitl.network.test_server import free_port

pytestmark = needs_browser

MISSIONS = Path(__file__).resolve().parents[2] / "missions"

DRAWN = """
const canvas = document.querySelector('canvas'), box = canvas.getContext('2d');
const data = box.getImageData(0, 0, canvas.width, canvas.height).data, seen = new Set();
for (let i = 0; i < data.length; i += 4 * 97) seen.add(data[i] << 16 | data[i + 1] << 8 | data[i + 2]);
return seen.size
"""
"""How many colours there are on the map."""
STICKS_OUT = """
return [...document.querySelectorAll('body *')].filter(one => one.checkVisibility() && !one.closest('.scroll')
    && (one.getBoundingClientRect().right > innerWidth + 1 || one.getBoundingClientRect().left < -1))
    .map(one => `${one.className}: ${one.textContent.slice(0, 60)}`)
"""
ORDER = """
return ['.stage', '.readouts', '.news-section', '.targets-section', '.facts-section', '.charts']
    .map(name => document.querySelector(name).getBoundingClientRect().top)
"""
"""How far down the parts of the page are."""
OVER_EACH_OTHER = """
const shown = [...document.querySelectorAll('.map-buttons button, .actions, .strip, .legend')]
    .filter(one => one.checkVisibility()).map(one => [one, one.getBoundingClientRect()]);
return shown.flatMap(([a, p], i) => shown.slice(i + 1).filter(([b, q]) => !a.contains(b) && !b.contains(a)
    && Math.min(p.right, q.right) - Math.max(p.left, q.left) > 1
    && Math.min(p.bottom, q.bottom) - Math.max(p.top, q.top) > 1)
    .map(([b]) => `${a.textContent.slice(0, 40)} / ${b.textContent.slice(0, 40)}`))
"""


EVENTS = """
const states = ['waiting', 'driving', 'waiting', 'stopped', 'stopped', 'driving', 'stopped'];
const frames = states.map((state, t) => ({ t, state, line: state, pose: [0, 0, 0] }));
return import('viewer/record.js').then(({ Record }) => new Record({ scene: {}, frames }).events)
    .then((events) => events.map((one) => [one.t, one.kind]))
"""
"""What is marked on the timeline of a run with these states."""
COLOURS = """
const canvas = document.querySelector('canvas'), box = canvas.getContext('2d'), count = {};
const data = box.getImageData(0, 0, canvas.width, canvas.height).data;
for (let i = 0; i < data.length; i += 4) {
    const key = '#' + [0, 1, 2].map(j => data[i + j].toString(16).padStart(2, '0')).join('');
    count[key] = (count[key] ?? 0) + 1;
}
return count
"""
"""How many pixels of the map have each colour."""
MIDDLE = """
const canvas = document.querySelector('canvas'), box = canvas.getContext('2d'), w = canvas.width, h = canvas.height;
const data = box.getImageData(0, 0, w, h).data;
let [n, x, y] = [0, 0, 0];
for (let i = 0; i < w * Math.floor(0.9 * h); i++) {  // below is the scale of colours
    const hex = '#' + [0, 1, 2].map(j => data[4 * i + j].toString(16).padStart(2, '0')).join('');
    if (hex === arguments[0]) [n, x, y] = [n + 1, x + i % w, y + Math.floor(i / w)];
}
return [n, x / n, y / n]
"""
"""How many pixels of the map have this colour, and where the middle of them is."""
LIGHT = {"unknown": "#9fa9b3", "free": "#ffffff", "obstacle": "#12181e", "rover": "#cc4200"}
DARK = {"unknown": "#101418", "free": "#4b5864", "obstacle": "#f3f6f8", "rover": "#ff7a33"}
"""Of the map, as the legend shows them."""
FAST = "#4a9a20"
"""The track where the rover drove at its cruise speed."""
SEEK = (
    "const s = document.querySelector('input[type=range]'); s.value = +s.max * arguments[0];"
    "s.dispatchEvent(new Event('input', {bubbles: true}))"
)
OLD_S = 2.0
"""Data of a run that goes on counts as old after less than this."""
PRESSED = "return [...document.querySelectorAll('.map-buttons [aria-pressed=true]')].map(b => b.innerText.trim())"
"""Buttons over the map that are pressed."""


FACTS = """
const text = (one, name) => one.querySelector(name).innerText;
return Object.fromEntries([...document.querySelectorAll('.fact')].map(one => [text(one, 'dt'), text(one, 'dd')]))
"""
TOLD = {
    "Link": r"good, \d+ ms",
    "Position": r"\d+\.\d a second",
    "Range sensor": r"\d+\.\d a second",
    "GPS": r".+, \d+ satellites",
    "Battery": r"\d+ %, \d+\.\d V",
    "Tick": r"\d+\.\d ms",
}
"""What some of the facts say while the rover drives."""
FIGURES = """
return Object.fromEntries([...document.querySelectorAll('.chart')].map(one => {
    const canvas = one.querySelector('canvas'), colour = getComputedStyle(document.body).getPropertyValue('--accent');
    const wanted = [1, 3, 5].map(at => parseInt(colour.trim().slice(at, at + 2), 16));
    const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
    let columns = new Set();
    for (let i = 0; i < data.length; i += 4)
        if (data[i + 3] > 200 && wanted.every((part, j) => Math.abs(part - data[i + j]) < 30))
            columns.add(i / 4 % canvas.width);
    return [one.querySelector('h3').innerText.replace(/[^a-z].*/is, ''), columns.size]
}))
"""
"""Of each figure: over how many columns of pixels its line goes."""
CAMERA = """
return import('viewer/camera.js').then(({ Camera }) => {
    const hold = Camera.prototype.hold;
    Camera.prototype.hold = function (...all) { window.camera = this; return hold.apply(this, all) };
})
"""
"""Keeps the map's camera where a test finds it."""


LOSE_PLACE = """
return import('viewer/model.js').then(({ Model }) => {
    const take = Model.prototype.takeFrame;
    Model.prototype.takeFrame = function (frame) {
        return take.call(this, { ...frame, rates: { ...frame.rates, position_age_s: 60 } });
    };
})
"""
"""From now on no position is heard."""
LOCKED = """
return Object.fromEntries([...document.querySelectorAll('.actions [aria-disabled]')].map(one =>
    [one.innerText.trim(), one.title]))
"""
"""Why buttons would do nothing."""
STRUCK = """
return [...document.querySelectorAll('.fact')].filter(one =>
    getComputedStyle(one.querySelector('dd')).textDecorationLine === 'line-through')
    .map(one => one.querySelector('dt').textContent)
"""
"""Facts that are shown as old."""


PRESS_LAST = """
const panel = document.querySelector('.panel');
panel.scrollTop = panel.scrollHeight;
const row = [...document.querySelectorAll('.decision-list li button:not(.more)')].at(-1);
row.scrollIntoView();
row.click();
return row.innerText
"""
"""Presses the last decision that is listed, far down the panel."""
IN_VIEW = """
const {top, bottom} = document.querySelector('.panel').getBoundingClientRect();
const low = document.querySelector('.tabs').getBoundingClientRect().bottom;
return [...document.querySelectorAll('.why-decision h2, .why-decision .reason')].filter(one =>
    one.getBoundingClientRect().top >= Math.max(top, low) && one.getBoundingClientRect().bottom <= bottom)
    .map(one => one.innerText.replace(/:.*/, ''))
"""
"""What of a decision's number and reason can be seen."""


PILOT = """
[[fault]]
kind = "pilot"
since = "driving"
start_s = 5.0
mode = "MANUAL"
"""


def address_of(program: Program) -> str:
    return program.says(r"the run is shown at (\S+)").group(1)


def web_process_of(program: Program) -> int | None:
    listed = subprocess.run(["ps", "-eo", "pid,ppid,args"], capture_output=True, text=True, check=True).stdout
    found = re.search(rf"^\s*(\d+)\s+{program.child.pid}\s.*companion\.viewer\.server", listed, re.MULTILINE)
    return None if found is None else int(found.group(1))


def clock_of(shown: Page) -> str:
    return str(shown.run("return document.querySelector('.clock').innerText"))


def test_a_run_can_be_watched_on_any_screen_and_again_after_the_web_process_was_killed(tmp_path: Path) -> None:
    name = f"the far end {'Kabeltrommellagerplatz' * 2}"  # with a word that is wider than a phone
    mission = tmp_path / "rooms.toml"
    text = (MISSIONS / "rooms.toml").read_text(encoding="utf-8").replace("far end", name)
    mission.write_text(text.replace('"maps/', f'"{MISSIONS}/maps/'), encoding="utf-8")
    token = tmp_path / "token"
    acting = ("--web-token", token, "--web-actions")
    with ours(tmp_path, "sitl", "drive", mission, "--web", "0", *acting, "--speedup", "1") as program:
        address = address_of(program)
        program.says(f"Heading for {name}")
        with page(DESKTOP) as desktop:
            desktop.open(f"{address}#token={token.read_text(encoding='ascii').strip()}")
            desktop.shows(f"Driving to {name}", "GUIDED", f"Heading for {name}", "companion")
            assert "#" not in desktop.driver.current_url, "nobody copies the token with the address"
            assert int(str(desktop.run(DRAWN))) > 8
            fits(desktop, DESKTOP)
            desktop.until(lambda: {name: text for name, text in TOLD.items()
                                   if not re.fullmatch(text, desktop.run(FACTS).get(name, ""))} == {})  # fmt: skip
            desktop.until(lambda: min(desktop.run(FIGURES).values()) > 5)
            desktop.run(CAMERA)
            zooms(desktop, lambda: desktop.turn_wheel("canvas.map", -300))
            desktop.press("Show everything (0)")
            killed = web_process_of(program)
            assert killed is not None
            os.kill(killed, signal.SIGKILL)
            desktop.until(lambda: web_process_of(program) not in (None, killed))
            desktop.until(lambda: "Driving to" in desktop.text)
            program.says("the page's process had ended; it was started again, and the drive went on")
            before = clock_of(desktop)
            desktop.until(lambda: clock_of(desktop) != before and "Driving to" in desktop.text)
            assert f"Heading for {name}" in desktop.text and "No connection" not in desktop.text
            assert [fault for fault in desktop.faults if "WebSocket" not in fault and "ERR_" not in fault] == []
            desktop.press("Pause")
            desktop.shows("HOLD", "Paused on request")
            assert "no longer steers" not in desktop.text, "it is told once"
            desktop.press("Go on")
            desktop.shows("GUIDED", "Going on as requested", "Go on: done")
            for _ in range(4):
                desktop.press("Zoom out (−)")
            desktop.press("What the signs mean (L)")
            desktop.shows("What the map shows")
            assert desktop.run(OVER_EACH_OTHER) == []
            desktop.press("Close")
            desktop.press("Send here")
            desktop.click_at("canvas", 60, 150)
            desktop.press("Send")
            desktop.shows("Send here: outside the mission's grid")
            desktop.press("Show everything (0)")
            desktop.press("Send here")
            desktop.click("canvas")
            desktop.press("Send")
            desktop.shows("Send here: done", "Requested goal 1")
            desktop.press("Skip target")
            desktop.shows("Leave out requested goal 1?")
            desktop.press("Skip")
            desktop.shows("Skip target: done", "Skipping requested goal 1 as requested")
            desktop.resize(PHONE)
            desktop.until(lambda: f"Driving to {name}" in desktop.text)
            assert re.search(r"live, simulated\s*\d+:\d\d", desktop.text), "on a phone, too"
            desktop.press("Skip target")
            desktop.shows(f"Leave out {name}?")
            fits(desktop, PHONE)
            desktop.press("Cancel")
            desktop.until(lambda: desktop.run("return window.camera.coveredRight") < 80)  # one column of buttons
            zooms(desktop, lambda: desktop.spread("canvas.map", 30, 90))
            assert desktop.run(STRUCK) == []
            desktop.run(LOSE_PLACE)
            desktop.until(lambda: desktop.run(STRUCK) == ["Goal", "Setpoint", "Position"])
            assert "grayscale" in str(desktop.run("return getComputedStyle(document.querySelector('.map')).filter"))
            desktop.run("sessionStorage.clear(); localStorage.clear()")
            desktop.open("about:blank")
            desktop.open(address)
            desktop.shows(f"Driving to {name}", "GUIDED")
            assert int(str(desktop.run(DRAWN))) > 8
            fits(desktop, PHONE)
            assert "Enter token to act" in desktop.text
            assert desktop.run("return document.querySelectorAll('.actions button').length") == 1, "nobody may act"
            desktop.press("Enter token to act")
            desktop.run("document.querySelector('#token').value = 'not the token'")
            desktop.press("Connect")
            desktop.shows("This token is wrong", f"Driving to {name}")
            assert "Not connected" not in desktop.text, "who may look on goes on looking"
            fits(desktop, PHONE)
            right = token.read_text(encoding="ascii").strip()
            desktop.run(f"location.hash = 'token={right}'")  # the address that was printed, opened in the same tab
            desktop.shows(f"Driving to {name}", "Skip target")
            assert "#" not in desktop.driver.current_url and "is needed" not in desktop.text
            program.child.send_signal(signal.SIGINT)
            desktop.shows("Stopped by the user", "Facts, as of the end")
            program.ended()
            time.sleep(OLD_S)
            assert desktop.run("return document.querySelector('.viewer').className") == "viewer", "it is not grey"
            assert desktop.run(STRUCK) == [], "what it came to is not old"
            port = address.rstrip("/").rpartition(":")[2]
            faults = tmp_path / "pilot.toml"
            faults.write_text(PILOT, encoding="utf-8")
            next_one = ("sitl", "drive", MISSIONS / "open.toml", "--faults", faults, "--web", port, *acting)
            with ours(tmp_path, *next_one, "--speedup", "1") as another:
                address_of(another)
                desktop.shows("Open ground", "Driving to half way")
                assert name not in desktop.text, "nothing of the run before is left"
                desktop.open("about:blank")
                desktop.open(f"{address}#token={token.read_text(encoding='ascii').strip()}")
                desktop.shows("MANUAL")
                desktop.shows("The pilot drives (MANUAL)")
                locked = {"Go on": "Not paused here", "Send here": "Only while the companion drives"}
                desktop.until(lambda: desktop.run(LOCKED) == locked)
                desktop.press("Send here")
                desktop.shows("Send here: only while the companion drives")
                another.child.send_signal(signal.SIGINT)


def zooms(shown: Page, how: Callable[[], None]) -> None:
    """The map is larger afterwards, and a person has moved it."""
    scale = "return window.camera?.scale ?? 0"
    shown.until(lambda: float(shown.run(scale)) > 0.0)
    before = float(shown.run(scale))
    how()
    shown.until(lambda: float(shown.run(scale)) > 1.3 * before)
    assert shown.run(PRESSED) in ([], ["Figures"])


def fits(shown: Page, size: tuple[int, int]) -> None:
    """Nothing is wider than the window, sticks out of it where it cannot be scrolled, or lies over a button."""
    assert int(str(shown.run("return document.documentElement.scrollWidth"))) <= size[0]
    assert shown.run(STICKS_OUT) == []
    assert shown.run(OVER_EACH_OTHER) == []


@pytest.mark.thorough
def test_the_simulator_alone_is_shown_as_such(tmp_path: Path) -> None:
    link = f"tcp:127.0.0.1:{free_port()}"
    serve = ("serve", MISSIONS / "depot.toml", "--web", "0", "--listen", link, "--speedup", "2")
    with ours(tmp_path, "sitl", *serve) as program, page(DESKTOP) as shown:
        shown.open(address_of(program))
        shown.shows("Simulator: waiting for somebody to connect", "Depot", "live, simulator", "listening on tcp:")
        shown.shows("Targets of the mission")
        assert "pending" not in shown.text and "Decision" not in shown.text
        assert int(str(shown.run(DRAWN))) > 8
        shown.press("What the signs mean (L)")
        shown.shows("open door")
        shown.resize(PHONE)
        fits(shown, PHONE)
        assert shown.faults == []
        run = ("run", MISSIONS / "depot.toml", "--connect", link, "--arm", "--web", "0")
        with ours(tmp_path, "companion", *run) as companion:
            shown.resize(DESKTOP)
            shown.open(address_of(companion))
            shown.shows("Depot", "live", "Driving to", "Targets")
            assert "simulat" not in shown.text, "for the companion it is a rover like any other"
            assert clock_of(shown).endswith(" UTC"), "a time of day, and which"
            assert re.fullmatch(r"driving to .* · Depot", str(shown.run("return document.title")))
            assert shown.faults == []
            companion.child.send_signal(signal.SIGINT)
            shown.shows("Stopped by the user")


@pytest.fixture(scope="module")
def report_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of a drive round an obstacle, opened at once in what the system says is its browser."""
    folder = tmp_path_factory.mktemp("report")
    browser = folder / "browser"
    browser.write_text(f'#!/bin/sh\necho "$1" > {folder}/opened\n')
    browser.chmod(0o755)
    with ours(folder, "sitl", "drive", MISSIONS / "one-obstacle.toml", "--record", "rec") as program:
        assert program.ended() == 0
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("BROWSER", f"{browser} %s")
        with ours(folder, "companion", "report", "rec", "--out", "report.html", "--open") as program:
            assert program.ended() == 0, program.output
    file = folder / "report.html"
    assert (folder / "opened").read_text() == f"{file.as_uri()}\n"
    return file


def test_a_report_plays_from_its_file_to_its_end(report_file: Path) -> None:
    file = report_file
    text = file.read_text(encoding="utf-8")
    assert file.stat().st_size < 2_000_000 and not re.search(r"(src|href)=\"(?!data:)", text)
    with page(DESKTOP) as report:
        report.open(file.as_uri())
        report.shows("record, simulated", "Done", "1 of 1 targets reached", "Mission ended")
        said = [report.text.index(text) for text in ("Mission ended", "Reached far end", "Heading for far end")]
        assert said == sorted(said), "what is new stands first"
        title = report.run("return document.title")
        assert report.run(EVENTS) == [[2, "stop"], [3, "stop"], [6, "stop"]]
        report.press("Tables")
        report.shows("Targets", "reached", "Stops and waits")
        report.press("Decisions")
        slider = "const s = document.querySelector('input[type=range]'); s.value = +s.max * arguments[0];"
        report.run(slider + "s.dispatchEvent(new Event('input', {bubbles: true}))", 0.7)
        report.shows("candidate", "cost", "taken")
        report.press("Now")
        both = slider + "for (const share of [0.5, arguments[1]]) { s.value = +s.max * share;"
        report.run(both + "s.dispatchEvent(new Event('input', {bubbles: true})) }", 0.5, 0.8)
        one_speed = (
            "const told = [...document.querySelectorAll('.readout-value, .chart h3 b')].map(one => one.innerText);"
            "return Math.abs(parseFloat(told[0]) - parseFloat(told[3])) <= 0.06"  # false while a figure shows none
        )
        report.until(lambda: report.run(one_speed), 5.0)
        report.run("const s = document.querySelector('select'); s.value = [...s.options].at(-1).value;"
                   "s.dispatchEvent(new Event('change', {bubbles: true}))")  # fmt: skip
        report.press("Play or pause (Space)")
        report.shows("Done")
        assert report.run("return document.title") == title, "a report keeps the title of its file"
        report.press("What the signs mean (L)")
        report.shows("stop, or held up on the way")
        report.press("What the signs mean (L)")
        report.press("Now")
        report.resize(PHONE)
        fits(report, PHONE)
        assert report.run(ORDER) == sorted(report.run(ORDER))
        for tab in ("Now", "Decisions", "Tables"):
            report.press(tab)
            fits(report, PHONE)
        assert report.faults == []


def test_a_report_is_walked_through_by_clicks(report_file: Path) -> None:
    def time_of() -> str:
        return str(report.run("return document.querySelector('output.time').innerText"))

    with page(DESKTOP) as report:
        report.open(report_file.as_uri())
        report.shows("1 of 1 targets reached")
        report.press("Decisions")
        row = ".decision-list li:nth-child(3) button"
        told = str(report.run(f"return document.querySelector('{row}').innerText"))
        report.click(row)
        current = "return document.querySelector('.decision-list [aria-current=true]')?.innerText"
        report.until(lambda: report.run(current) == told)
        assert told.split(maxsplit=1)[0] in report.text and not time_of().startswith("0:00")
        place = "return document.querySelector('.decision-list').scrollTop"
        report.run(SEEK, 1.0)
        report.until(lambda: int(report.run(place)) > 0)
        report.run(SEEK, 0.0)
        report.shows("No decision yet.")
        report.until(lambda: int(report.run(place)) == 0, 10.0)  # the first ones are to be seen
        report.press("Now")
        at_row = time_of()
        report.click_at("canvas.marks", 200, 5)
        report.until(lambda: time_of() != at_row)
        report.run(SEEK, 0.6)  # straight on so far
        report.until(lambda: report.run(MIDDLE, FAST)[1] is not None)  # drawn in the next frame
        _, right, down = report.run(MIDDLE, FAST)
        before = time_of()
        report.click_at("canvas", round(right), round(down))
        report.until(lambda: "0:45" < time_of() < before)
        report.run(SEEK, 0.8)
        report.until(lambda: time_of() > before)
        colours = {name: report.run(COLOURS).get(value, 0) for name, value in LIGHT.items()}
        assert min(colours["unknown"], colours["free"]) > 5000 and min(colours.values()) > 30, colours
        rover = report.run(MIDDLE, LIGHT["rover"])
        assert report.run(PRESSED) == ["All", "Figures"]
        report.drag("canvas", 120, 60)
        moved = report.run(MIDDLE, LIGHT["obstacle"])
        assert report.run(PRESSED) == ["Figures"] and report.run(MIDDLE, LIGHT["rover"]) != rover
        report.press("Follow the rover (F)")
        assert report.run(PRESSED) == ["Follow", "Figures"] and report.run(MIDDLE, LIGHT["obstacle"]) != moved
        report.press("North is up; press for heading up")
        report.shows("Ahead")
        report.darken()
        report.until(lambda: report.run(COLOURS).get(DARK["free"], 0) > 5000)
        dark = report.run(COLOURS)
        assert all(dark.get(value, 0) > 30 for value in DARK.values())
        assert (
            report.run("return getComputedStyle(document.querySelector('.viewer')).backgroundColor")
            == "rgb(10, 13, 16)"
        )
        assert report.faults == []


@pytest.mark.parametrize("size", [DESKTOP, PHONE])
def test_a_decision_that_is_pressed_in_the_list_shows_its_why(report_file: Path, size: tuple[int, int]) -> None:
    """However far down the list it stands, and though the list is built anew around it."""
    with page(size) as report:
        report.open(report_file.as_uri())
        report.press("Decisions")
        report.run(SEEK, 0.6)
        told = report.run(PRESS_LAST)
        number, reason = re.fullmatch(r".*?\d:\d\d\s*(\d+)\s*\w+: (.*)", told, re.DOTALL).groups()
        report.until(lambda: report.run(IN_VIEW) == [f"Decision {number}", reason])
        assert report.faults == []


@pytest.mark.thorough
def test_records_are_laid_over_each_other(tmp_path: Path) -> None:
    mission = MISSIONS / "one-obstacle.toml"
    for number in range(2):
        with ours(tmp_path, "sitl", "drive", mission, "--seed", number, "--record", f"rec{number}") as program:
            assert program.ended() == 0
    shutil.copytree(tmp_path / "rec1", tmp_path / "recorded-in-the-yard-20261126_101112")
    records = ("rec0", "rec1", "recorded-in-the-yard-20261126_101112")
    with ours(tmp_path, "companion", "report", *records, "--out", "both.html") as program:
        assert program.ended() == 0, program.output
    with page(DESKTOP) as report:
        report.open((tmp_path / "both.html").as_uri())
        report.shows("rec1")
        report.press("Tables")
        report.shows("Differences")
        scrolls = "return [...document.querySelectorAll('.scroll')].filter(one => one.scrollWidth > one.clientWidth)"
        assert report.run(f"{scrolls}.length") == 0, "three beside each other fit"
        assert report.faults == []
