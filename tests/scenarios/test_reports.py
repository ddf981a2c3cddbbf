"""What is made of a record: tables, messages for other programs, films. The same record gives the same bytes."""

from __future__ import annotations

import base64
import csv
import gzip
import json
import re
import shutil
import sys
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from PIL import Image
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from typer.testing import CliRunner

from companion.app import Companion, Status
from companion.cli.commands import app
from companion.core.extras import not_installed
from companion.core.frames import GeoPoint, LocalFrame
from companion.recording.reader import load_record
from companion.replay.replay import Observers, replay
from companion.safety.reasons import EndReason
from companion.viewer import frame, report_data, report_mcap
from companion.viewer.film_picture import REACHED, ROVER, TRACK
from companion.viewer.frame import doing_of
from companion.viewer.headway import Headway
from companion.viewer.report_csv import FILES
from companion.viewer.report_data import ReportWatch, as_json, counted, joined, run_of
from companion.viewer.report_film import Film
from companion.viewer.report_page import report_page
from companion.viewer.report_tables import tables_of
from companion.viewer.run_tally import RunTally
from companion.viewer.wire import tiles_in
from tests.support.full_disk import full_after
from tests.support.quick import first_of
from tests.support.records import START_US, recorded, write_record
from tests.support.reports import report_data_in
from tests.support.rig import yard

FFMPEG = shutil.which("ffmpeg")


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("yard")
    return recorded(folder / "record", yard(folder))


@pytest.fixture(scope="module")
def made(record: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a record in all forms."""
    return made_of(record, tmp_path_factory.mktemp("made"))


def made_of(record: Path, folder: Path) -> Path:
    forms = [
        "--csv",
        folder / "csv",
        "--mcap",
        folder / "r.mcap",
        "--out",
        folder / "r.html",
        "--gif",
        folder / "r.gif",
        *(["--mp4", folder / "r.mp4"] if FFMPEG else []),
    ]
    result = CliRunner().invoke(app, ["report", str(record), *map(str, forms)])
    assert result.exit_code == 0 and f"film: {folder / 'r.gif'} (" in result.output, result.output
    return folder


def rows_of(file: Path) -> list[dict[str, str]]:
    with file.open(encoding="utf-8", newline="") as opened:
        return list(csv.DictReader(opened))


@pytest.mark.thorough
def test_the_same_record_gives_the_same_bytes(record: Path, made: Path, tmp_path: Path) -> None:
    again = made_of(record, tmp_path)
    names = sorted(file.relative_to(made) for file in made.rglob("*") if file.is_file())
    assert len(names) >= 5
    assert [name for name in names if (made / name).read_bytes() != (again / name).read_bytes()] == []


def test_tables_have_every_decision_pose_and_setpoint(record: Path, made: Path) -> None:
    loaded = load_record(record)
    decided = [json.loads(line) for line in loaded.decisions]
    decisions = rows_of(made / "csv" / "decisions.csv")
    assert [row["number"] for row in decisions] == [str(number) for number in range(1, len(decided) + 1)]
    for row, one in zip(decisions, decided, strict=True):
        assert float(row["time_s"]) == pytest.approx(one["time_s"], abs=1e-3)
        assert (row["action"], row["reason"], row["path_fields"]) == (
            one["action"],
            one["reason"],
            str(len(one["path"])),
        )
    assert {row["planner"] for row in decisions if row["searches"]} == {"hybrid"}
    poses = rows_of(made / "csv" / "pose.csv")
    assert len(poses) > 300 and [float(row["time_s"]) for row in poses] == sorted(float(row["time_s"]) for row in poses)
    last, first = poses[-1], next(row for row in poses if row["latitude_deg"])
    assert last["time_utc"].startswith("2027-01-15T08:") and (first["mode"], last["mode"]) == ("MANUAL", "GUIDED")
    places = [GeoPoint(float(row["latitude_deg"]), float(row["longitude_deg"])) for row in (first, last)]
    moved = LocalFrame(places[0]).to_ned(places[1])
    assert moved.east_m == pytest.approx(float(last["east_m"]) - float(first["east_m"]), abs=0.01)
    setpoints = rows_of(made / "csv" / "setpoints.csv")
    said = [raw for tick in loaded.ticks() for raw in tick.said]
    told = [raw for raw in said if raw[7:10] == bytes((84, 0, 0))]  # SET_POSITION_TARGET_LOCAL_NED
    assert sum(row["kind"] != "speed" for row in setpoints) == len(told) > 10
    assert {row["kind"] for row in setpoints} >= {"position", "speed", "velocity"}


def test_the_page_of_a_report_knows_how_often_data_came(made: Path) -> None:
    frames = report_data_in(made / "r.html")["frames"]
    rates = [frame["rates"] for frame in frames if "rates" in frame]
    middle = rates[len(rates) // 2]
    assert 5.0 < middle["position"] < 25.0 and 5.0 < middle["range"] < 25.0
    assert middle["heartbeat_age_s"] < 1.5 and middle["position_age_s"] < 0.3


def test_who_goes_to_a_decision_sees_its_new_path(made: Path) -> None:
    data = report_data_in(made / "r.html")
    told = {"new path", "current path blocked: new path", "a better path"}
    decided = [one["t"] for one in data["decisions"] if one["reason"] in told]
    shown = [one["t"] for one in data["frames"] if "path" in one]
    assert len(decided) > 1 and [t for t in decided if t not in shown] == []


LAPS_S = 600.0
"""So long a drive is what the size of a report is told for."""


def driven_on(data: dict[str, Any], seconds: float) -> dict[str, Any]:
    """The data of a report whose drive goes on for so long: its moments again and again, with as many rays as a frame
    may have, and each time with other numbers and tiles, so that nothing is packed as a copy of the lap before."""
    rng = np.random.default_rng(0)
    begin_s, end_s = next(one["t"] for one in data["frames"] if one.get("state") == "driving"), data["frames"][-1]["t"]
    lap_s = end_s - begin_s

    def other(value: Any) -> Any:
        match value:
            case float():
                return round(value + rng.uniform(-0.5, 0.5), 3)
            case list():
                return [other(one) for one in value]
            case dict():
                return {key: other(one) for key, one in value.items()}
        return value

    def again(one: dict[str, Any], lap: int) -> dict[str, Any]:
        copy = {**other(one), "t": round(one["t"] + lap * lap_s, 2)}
        if copy.get("rays"):
            copy["rays"]["m"] = np.round(rng.uniform(0.3, 8.0, frame.MOST_RAYS), 2).tolist()
        return copy

    def mixed(tile: str) -> str:
        return base64.b64encode(rng.permutation(list(base64.b64decode(tile))).astype(np.uint8).tobytes()).decode()

    laps = range(1, round(seconds / lap_s) + 1)
    for name in ("frames", "decisions"):
        driven = [one for one in data[name] if one["t"] >= begin_s]
        data[name] += [again(one, lap) for lap in laps for one in driven]
    driven = [(time_s, tile) for time_s, tile in data["tiles"] if time_s >= begin_s]
    data["tiles"] += [[time_s + lap * lap_s, mixed(tile)] for lap in laps for time_s, tile in driven]
    return data


def test_ten_minutes_of_driving_make_a_report_of_less_than_five_megabytes(made: Path) -> None:
    data = driven_on(report_data_in(made / "r.html"), LAPS_S)
    driven = [one for one in data["frames"] if one["t"] >= data["frames"][-1]["t"] - LAPS_S]
    assert len(driven) > 1400 and len(data["decisions"]) > 1000
    assert 1_000_000 < len(report_page("Yard", as_json(data)).encode()) < 5_000_000


REQUIRED = {
    "foxglove.FrameTransform": "timestamp parent_frame_id child_frame_id translation rotation",
    "foxglove.PoseInFrame": "timestamp frame_id pose",
    "foxglove.LocationFix": "timestamp frame_id latitude longitude altitude position_covariance "
    "position_covariance_type",
    "foxglove.LaserScan": "timestamp frame_id pose start_angle end_angle ranges intensities",
    "foxglove.Grid": "timestamp frame_id pose column_count cell_size row_stride cell_stride fields data",
    "foxglove.SceneUpdate": "deletions entities",
    "foxglove.Log": "timestamp level message name file line",
}
"""As Foxglove's documentation lists them."""


def fits(value: Any, schema: dict[str, Any]) -> bool:
    """Whether a value is as its schema says, with all its fields and no others."""
    match schema["type"]:
        case "object":
            fields = schema.get("properties")
            return isinstance(value, dict) and (
                fields is None
                or (value.keys() == fields.keys() and all(fits(value[key], fields[key]) for key in fields))
            )
        case "array":
            return isinstance(value, list) and all(fits(one, schema["items"]) for one in value)
        case kind:
            types = {"number": (int, float), "integer": int, "string": str, "boolean": bool}
            return isinstance(value, types[kind])


def test_messages_are_read_back_as_their_schemas_say(record: Path, made: Path) -> None:
    found: dict[str, list[tuple[int, dict[str, Any]]]] = defaultdict(list)
    schemas: dict[str, dict[str, Any]] = {}
    with (made / "r.mcap").open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            assert schema is not None and (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            value = json.loads(message.data)
            found[channel.topic].append((message.log_time, value))
            schemas[schema.name] = json.loads(schema.data)
            if schema.name in REQUIRED:
                assert value.keys() == set(REQUIRED[schema.name].split())
            if not schema.name.startswith("foxglove"):  # what is not known yet is null there
                value = {key: one for key, one in value.items() if one is not None}
                fields = schemas[schema.name]["properties"]
                assert all(fits(one, fields[key]) for key, one in value.items()), value
                continue
            assert fits(value, schemas[schema.name]), value
    assert schemas.keys() > REQUIRED.keys()
    poses = rows_of(made / "csv" / "pose.csv")
    assert len(found["/pose"]) == len(found["/tf"]) == len(found["/state"]) == len(poses)
    at_ns, last = found["/pose"][-1]
    assert last["pose"]["position"]["x"] == pytest.approx(float(poses[-1]["east_m"]), abs=0.002)
    assert at_ns == pytest.approx(1000 * START_US + 1e9 * (float(poses[-1]["time_s"]) - 0.05), abs=2e6)
    assert len(found["/decision"]) == len(load_record(record).decisions)
    assert any(one["message"] == "Reached gate" and one["name"] == "companion" for _, one in found["/log"])
    assert max(max(one["ranges"]) for _, one in found["/scan"]) > 3.0
    assert all(len(one["intensities"]) == len(one["ranges"]) for _, one in found["/scan"])
    ground = found["/map"][-1][1]
    rows = len(base64.b64decode(ground["data"])) / ground["row_stride"]
    assert rows == int(rows) > 20 and ground["column_count"] > 20
    assert found["/path"][0][1]["entities"][0]["lines"][0]["points"]
    assert [one["entities"][0]["texts"][0]["text"] for _, one in found["/targets"]] == ["gate"]


def test_without_the_extra_one_line_says_how_to_install_it(
    record: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "mcap", None)
    result = CliRunner().invoke(app, ["report", str(record), "--mcap", str(tmp_path / "r.mcap")])
    assert (result.exit_code, result.output) == (2, not_installed("--mcap", "mcap", "mcap") + "\n")
    assert not (tmp_path / "r.mcap").exists()


def test_a_film_shows_the_drive_from_its_beginning_to_its_end(made: Path) -> None:
    with Image.open(made / "r.gif") as film:
        assert film.format == "GIF" and 20 < film.n_frames <= 300 and film.info["loop"] == 0
        assert max(film.size) < 700 and (made / "r.gif").stat().st_size < 1_000_000
        pictures = []
        for number in (0, film.n_frames - 1):
            film.seek(number)
            pictures.append(film.convert("RGB"))
    first, last = (Counter(one.get_flattened_data()) for one in pictures)
    white, black = ((255, 255, 255), (18, 24, 30))
    assert near(last, white) > 1.1 * near(first, white), "more ground is known"
    assert near(last, black) > near(first, black), "and more of what stands there"
    assert near(last, TRACK) > 200 > near(first, TRACK)
    assert near(last, ROVER) > 20 and near(last, REACHED) > 20


def near(found: Counter[tuple[int, ...]], colour: tuple[int, int, int]) -> int:
    """How many pixels have about this colour."""
    return sum(count for one, count in found.items() if all(abs(a - b) < 12 for a, b in zip(one, colour, strict=True)))


@pytest.mark.thorough
def test_a_map_that_is_larger_than_a_look_is_whole_in_the_first_moment_and_in_the_last(
    record: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def tiles() -> tuple[dict[Any, bytes], dict[Any, bytes]]:
        watch = ReportWatch(load_record(record))
        replay(load_record(record), watch)
        told = [dict(tiles_in(base64.b64decode(message))) for _, message in watch.tiles]
        return told[0], {place: cells for message in told for place, cells in message.items()}

    first, last = tiles()
    monkeypatch.setattr(report_data, "LOOK_S", 0.01)
    assert tiles() == (first, last) and len(last) >= len(first) > 3


@pytest.mark.thorough
def test_a_map_that_is_large_is_written_for_other_programs_less_often(
    record: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def maps(file: Path) -> int:
        assert CliRunner().invoke(app, ["report", str(record), "--mcap", str(file)]).exit_code == 0
        with file.open("rb") as data:
            return sum(1 for _ in make_reader(data).iter_messages(topics=["/map"]))

    usual = maps(tmp_path / "usual.mcap")
    monkeypatch.setattr(report_mcap, "MAP_BYTES_A_SECOND", 1.0)
    assert 1 <= maps(tmp_path / "large.mcap") <= 2 < usual


@pytest.mark.skipif(FFMPEG is None, reason="no ffmpeg")
def test_the_film_is_made_by_ffmpeg_too(record: Path, made: Path) -> None:
    data = (made / "r.mp4").read_bytes()
    assert data[4:8] == b"ftyp" and b"avc1" in data and 10_000 < len(data) < 1_000_000
    assert not (record / "report.html").exists()


@first_of(
    1,
    ("script", "says"),
    [
        (None, "--mp4: ffmpeg is not installed; install it (apt-get install ffmpeg), or use --gif"),
        ("#!/bin/sh\necho Unknown encoder libx264 >&2\nexit 8\n", "ffmpeg gave up: Unknown encoder libx264; use --gif"),
        (
            "#!/bin/sh\n: > ${0%ffmpeg}r.mp4\necho Unable to re-open the file: No space left on device >&2\n",
            "r.mp4: cannot be written: No space left on device",
        ),
    ],
)
def test_an_ffmpeg_that_is_missing_or_gives_up_is_one_line(
    record: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, script: str | None, says: str
) -> None:
    if script is not None:
        (tmp_path / "ffmpeg").write_text(script)
        (tmp_path / "ffmpeg").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    result = CliRunner().invoke(app, ["report", str(record), "--mp4", str(tmp_path / "r.mp4")])
    assert result.exit_code == 2 and f"{says}" in result.output and result.output.count("\n") == 1


@pytest.mark.thorough
def test_where_there_is_no_browser_open_says_what_to_open(
    record: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("webbrowser.open", lambda address: False)
    file = tmp_path / "r.html"
    result = CliRunner().invoke(app, ["report", str(record), "--out", str(file), "--open"])
    assert result.exit_code == 0
    assert result.stderr == f"no browser was found on this computer; open {file.resolve().as_uri()}\n"


@pytest.mark.thorough
def test_a_film_of_a_record_that_was_cut_says_so_at_its_end(broken_off: Path) -> None:
    """The rover may have driven on."""
    record = load_record(broken_off)
    tally, watched = RunTally(), ReportWatch(record)
    data = joined(record, watched, run_of(record, tally, replay(record, Observers((tally, watched)))), [])
    assert not data["scene"]["cut"] and Film(data).moments()[-1]["state"] != "cut"
    data["scene"]["cut"] = True
    last = Film(data).moments()[-1]
    assert (last["line"], last["speed"]) == ("the record was cut short here", None)


def test_there_is_no_film_of_a_mission_that_had_not_begun(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["report", str(write_record(tmp_path)), "--gif", str(tmp_path / "r.gif")])
    assert (result.exit_code, result.output.count("\n")) == (2, 1) and "the mission had not begun" in result.output


SILENT = """
[[fault]]
kind = "sensor_silent"
since = "driving"
start_s = 3.0
duration_s = 1.6
"""


def test_several_records_are_compared_on_the_terminal_and_on_the_page(tmp_path: Path) -> None:
    """Broken off before the rover could drive: that takes hardly any time."""
    records = [recorded(tmp_path / f"record-{limit_s}", yard(tmp_path), limit_s=limit_s) for limit_s in (1, 2, 3)]
    result = CliRunner().invoke(app, ["report", *map(str, records), "--out", str(tmp_path / "r.html")])
    assert result.exit_code == 0, result.output
    lines = result.output.replace("\xa0", " ").splitlines()[1:]
    assert lines[0].split() == ["record-1", "record-2", "record-3"]
    time_s, second_s, more, third_s, much_more = next(line for line in lines if "time, s" in line).split()[-5:]
    assert float(second_s) - float(time_s) == pytest.approx(float(more[1:-1]), abs=0.11) == pytest.approx(1.0, abs=0.2)
    assert float(third_s) - float(time_s) == pytest.approx(float(much_more[1:-1]), abs=0.11)
    data = report_data_in(tmp_path / "r.html")
    assert [one["name"] for one in data["others"]] == ["record-2", "record-3"]
    assert data["tables"][0]["title"] == "Differences"


@pytest.mark.thorough
def test_several_records_are_compared_in_figures(record: Path, tmp_path: Path) -> None:
    (tmp_path / "silent.toml").write_text(SILENT)
    other = recorded(tmp_path / "other", yard(tmp_path), tmp_path / "silent.toml")
    result = CliRunner().invoke(app, ["report", str(record), str(other), "--out", str(tmp_path / "r.html")])
    assert result.exit_code == 0, result.output
    table = {line[:15].strip().replace("\xa0", " "): line[15:].split() for line in result.output.splitlines()[1:]}
    assert table[""] == ["record", "other"]
    assert table["stops"] == ["0", "1", "(+1)"] and table["targets reached"] == ["1", "1", "(±0)"]
    longer_s = float(table["time, s"][1]) - float(table["time, s"][0])
    assert longer_s > 0.5 and table["time, s"][2] == f"({longer_s:+.1f})"
    assert table["contacts"] == ["-", "-"], "the clock is not a simulator's: nobody knows of contacts"
    data = data_in(tmp_path / "r.html")
    assert [one["name"] for one in data["others"]] == ["other"] and data["tables"][0]["title"] == "Differences"
    tables = {one["title"]: one["rows"] for one in tables_of(counted(load_record(other)))}
    assert [row[:2] for row in tables["Watchdogs"]] == [["range data ahead silent for over 1 s", "1"]]
    assert ["stopped: range data ahead silent for over 1 s", "1"] in [row[:2] for row in tables["Stops and waits"]]
    name, status, reached_s, driven_m, straight_m = tables["Targets"][0]
    assert (name, status) == ("gate", "reached") and 12.0 < float(straight_m) < float(driven_m) < 20.0
    assert 45.0 < float(reached_s) < 70.0


def data_in(file: Path) -> dict[str, Any]:
    found = re.search(r'id="record" type="application/octet-stream">([^<]+)<', file.read_text(encoding="utf-8"))
    assert found is not None
    data: dict[str, Any] = json.loads(gzip.decompress(base64.b64decode(found[1])))
    return data


@pytest.mark.thorough
def test_the_energy_is_what_the_autopilot_says_it_was(record: Path) -> None:
    energy = counted(load_record(record)).tally.energy
    consumed = [
        (message.current_consumed / 1000.0, message.energy_consumed / 36.0)
        for tick in load_record(record).ticks()
        for raw in tick.heard
        if isinstance(message := mavlink.MAVLink(None).decode(bytearray(raw)), mavlink.MAVLink_battery_status_message)
    ]
    charge_ah, energy_wh = consumed[-1]
    assert energy.charge_ah == pytest.approx(charge_ah, rel=0.05) and charge_ah > 0.05
    assert energy.energy_wh == pytest.approx(energy_wh, rel=0.05)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--mcap", "{record}/link.tlog"], "the name must end with .mcap"),
        (["--gif", "{folder}/yard.toml"], "the name must end with .gif"),
        (["--csv", "{record}/meta.json"], "cannot be written"),
        (["--gif", "{folder}/x.gif", "--open"], "--open shows the HTML file: name it with --out as well"),
    ],
)
def test_what_cannot_be_written_is_one_line_and_no_record_is_harmed(
    record: Path, tmp_path: Path, options: list[str], says: str
) -> None:
    before = {file: file.read_bytes() for file in record.rglob("*") if file.is_file()}
    given = [one.format(record=record, folder=tmp_path) for one in options]
    result = CliRunner().invoke(app, ["report", str(record), *given])
    assert (result.exit_code, result.output.count("\n")) == (2, 1) and says in result.output
    assert {file: file.read_bytes() for file in record.rglob("*") if file.is_file()} == before
    assert list(tmp_path.iterdir()) == []


@pytest.mark.thorough
@first_of(1, ("option", "place"), [("--out", "r.html"), ("--gif", "r.gif"), ("--mcap", "r.mcap"), ("--csv", "csv")])
def test_a_full_disk_leaves_what_was_there_and_nothing_cut(
    record: Path, tmp_path: Path, option: str, place: str
) -> None:
    old = [tmp_path / "csv" / name for name in FILES] if option == "--csv" else [tmp_path / place]
    for file in old:
        file.parent.mkdir(exist_ok=True)
        file.write_text("old")
    with full_after(1000):
        result = CliRunner().invoke(app, ["report", str(record), option, str(tmp_path / place)])
    says = f"{tmp_path / place}: cannot be written: File too large; choose another place"
    assert (result.exit_code, result.output.splitlines()) == (2, [says])
    assert sorted(file for file in tmp_path.rglob("*") if file.is_file()) == sorted(old)
    assert {file.read_text() for file in old} == {"old"}


@pytest.mark.thorough
def test_a_full_disk_leaves_no_empty_folder(record: Path, tmp_path: Path) -> None:
    with full_after(1000):
        result = CliRunner().invoke(app, ["report", str(record), "--csv", str(tmp_path / "new")])
    assert result.exit_code == 2 and "cannot be written" in result.output
    assert list(tmp_path.iterdir()) == []


@pytest.fixture(scope="module")
def broken_off(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The record of a drive that was broken off in its middle."""
    folder = tmp_path_factory.mktemp("broken off")
    return recorded(folder / "record", yard(folder), limit_s=52.5)


@pytest.mark.thorough
def test_a_report_reaches_the_last_moment_of_a_drive_that_was_broken_off_and_says_so(
    broken_off: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also a stop is seen that was shorter than the time between two frames."""

    def doing(companion: Companion, status: Status, headway: Headway | None = None) -> dict[str, Any]:
        told = doing_of(companion, status, headway)
        return {**told, "state": "stopped"} if abs(status.time_s - 50.15) < 0.01 else told

    for module in (report_data, frame):
        monkeypatch.setattr(module, "doing_of", doing)
    record = load_record(broken_off)
    tally, watched = RunTally(), ReportWatch(record)
    run = run_of(record, tally, replay(record, Observers((tally, watched))))
    data = joined(record, watched, run, [])
    times = [one["t"] for one in data["frames"]]
    assert times[-1] == round(run.result.seconds, 2) >= data["decisions"][-1]["t"]
    assert times[-1] - times[-2] < 0.39, "no frame was due"
    states = [(one["t"], one["state"]) for one in data["frames"] if "state" in one]
    assert [state for _, state in states][-3:] == ["driving", "stopped", "driving"]
    assert states[-1][0] - states[-2][0] == pytest.approx(0.05)
    paths = sum("new path" in one["reason"] for one in data["decisions"])
    assert len(times) < run.result.seconds / 0.4 + 5 + paths, "and one where each new path is decided"
    record.meta.ended_by = EndReason.STOPPED_BY_USER.name
    last = joined(record, watched, run, [])["frames"][-1]
    assert (last["state"], last["t"]) == ("ended", times[-1]) and last["line"].startswith("stopped by the user: ")
