"""Results of runs on the disk: nothing lost, nothing counted twice, nothing of other code."""

from __future__ import annotations

import json
import shutil
import tempfile
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.campaign.campaign_file import CampaignTable
from sitl.campaign.policies import ERROR
from sitl.campaign.run_spec import RunResult, specs_of
from sitl.campaign.run_store import Digests, RunStore, _check_of
from sitl.generators.measures import Difficulty

TABLE = CampaignTable(name="c", worlds=["clutter", "yard"], runs=3)
SPECS = list(specs_of(TABLE))
GROUND = Difficulty(1.5, 4.25, 3.5, 5.0, 1.125)
RESULT = RunResult("points", "reached", 1, 1, seconds=31.25, metres=40.1, dwelt=((1, 2, 3),), ground=GROUND)


def filled(folder: Path, digest: str = "d") -> RunStore:
    store = RunStore(folder / "runs.jsonl", lambda spec: digest)
    for number, spec in enumerate(SPECS):
        store.add(spec, replace(RESULT, seconds=30.0 + number))
    return store


def test_what_was_kept_is_there_again_and_counts_once(tmp_path: Path) -> None:
    store = filled(tmp_path)
    store.add(SPECS[0], replace(RESULT, seconds=99.0))
    again = RunStore(store.file, lambda spec: "d")
    assert again.results == store.results and again.results[SPECS[0].id].seconds == 30.0
    assert len(store.file.read_text().splitlines()) == len(SPECS) and (again.torn, again.older) == (0, 0)


@given(st.integers(0, 2000), st.integers(0, 255))
def test_a_file_that_was_cut_and_damaged_anywhere_gives_only_what_was_written(cut: int, sign: int) -> None:
    folder = Path(tempfile.mkdtemp())
    try:
        store = filled(folder)
        data = bytearray(store.file.read_bytes())
        data[cut % len(data)] = sign
        store.file.write_bytes(bytes(data[: max(cut, len(data) // 2)]))
        again = RunStore(store.file, lambda spec: "d")
        assert again.results.items() <= store.results.items()
        again.add(SPECS[-1], store.results[SPECS[-1].id])
        assert SPECS[-1].id in RunStore(store.file, lambda spec: "d").results, "a torn line takes no other with it"
    finally:
        shutil.rmtree(folder)


def test_lines_of_other_code_do_not_count_and_a_changed_line_is_noticed(tmp_path: Path) -> None:
    store = filled(tmp_path)
    other = RunStore(store.file, lambda spec: "other")
    assert other.results == {} and other.older == len(SPECS)
    lines = store.file.read_text().splitlines()
    lines[2] = lines[2].replace('"touched":0', '"touched":1')
    store.file.write_text("\n".join(lines) + "\n")
    again = RunStore(store.file, lambda spec: "d")
    assert again.torn == 1 and len(again.results) == len(SPECS) - 1
    assert json.loads(lines[0])["id"] == SPECS[0].id


@pytest.mark.parametrize(
    ("changes", "torn"),
    [
        ({"run": {"world": "rooms gone_m=1.4"}}, 0),
        ({"run": {"sensors": "lidar-360 gone=1"}}, 0),
        ({"run": {"world": "gone.toml"}}, 0),
        ({"run": {"planner": "gone:Gone"}}, 0),
        ({"run": {"world": 3}}, 1),
        ({"run": {"world": ["clutter"]}}, 1),
        ({"result": {"more": 1}}, 1),
    ],
)
def test_a_line_of_another_version_is_left_out_and_told(
    tmp_path: Path, changes: dict[str, dict[str, object]], torn: int
) -> None:
    """A parameter that was renamed since ended every later start in a traceback."""
    store = filled(tmp_path)
    body = json.loads(store.file.read_text().splitlines()[0])
    del body["check"]
    for part, values in changes.items():
        body[part].update(values)
    text = json.dumps({**body, "check": _check_of(body)})
    store.file.write_text(f"{store.file.read_text()}{text}\n{'[' * 100_000}\n")
    digests = Digests(tmp_path)
    again = RunStore(store.file, lambda spec: "d" if spec in SPECS else digests.of(spec))
    assert again.results == store.results and (again.torn, again.older) == (1 + torn, 1 - torn)


def test_a_run_depends_on_its_own_files_alone(tmp_path: Path) -> None:
    for name in ("m", "n"):
        (tmp_path / f"{name}.toml").write_text("[[target]]\nnorth_m = 1.0\neast_m = 2.0\n")
    one, other = (replace(SPECS[0], world=f"{name}.toml") for name in ("m", "n"))
    before = [Digests(tmp_path).of(spec) for spec in (one, other, SPECS[0])]
    (tmp_path / "m.toml").write_text("[[target]]\nnorth_m = 1.0\neast_m = 3.0\n")
    after = [Digests(tmp_path).of(spec) for spec in (one, other, SPECS[0])]
    assert after[0] != before[0] and after[1:] == before[1:]
    (tmp_path / "m.toml").unlink()
    assert Digests(tmp_path).of(one) == ""


def test_a_run_depends_on_the_picture_that_its_world_is_drawn_on(tmp_path: Path) -> None:
    (tmp_path / "base.png").write_bytes(b"before")
    (tmp_path / "w.toml").write_text('base = "base.png"\n')
    (tmp_path / "m.toml").write_text('[[target]]\nnorth_m = 1.0\neast_m = 2.0\n[sitl]\nworld = "w.toml"\n')
    spec = replace(SPECS[0], world="m.toml")
    before = Digests(tmp_path).of(spec)
    (tmp_path / "base.png").write_bytes(b"after")
    assert Digests(tmp_path).of(spec) not in (before, "")


def test_a_run_depends_on_the_source_of_its_own_controller(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "own_part.py").write_text("class Own: ...\n")
    monkeypatch.chdir(tmp_path)
    own, shipped = (replace(SPECS[0], controller=name) for name in ("own_part:Own", "points"))
    together = Digests(tmp_path)
    assert together.of(shipped) != together.of(own), "one's digest is not the other's"
    assert together.of(own) == Digests(tmp_path).of(own) != ""


def test_a_run_depends_on_what_its_own_part_may_import(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The files beside a module, and all those of a package; nothing of another folder."""
    for file in ("beside.py", "part_in_file.py", "pack_of_mine/__init__.py", "pack_of_mine/deep/__init__.py"):
        (tmp_path / file).parent.mkdir(exist_ok=True)
        (tmp_path / file).write_text("class Own: ...\n")
    monkeypatch.chdir(tmp_path)
    names = ("part_in_file:Own", "pack_of_mine.deep:Own", "points")
    specs = [replace(SPECS[0], controller=name) for name in names]

    def changed_by(file: str) -> list[bool]:
        before = [Digests(tmp_path).of(spec) for spec in specs]
        (tmp_path / file).write_text((tmp_path / file).read_text() + "# other\n")
        return [Digests(tmp_path).of(spec) != one for spec, one in zip(specs, before, strict=True)]

    assert changed_by("beside.py") == [True, False, False]
    assert changed_by("pack_of_mine/__init__.py") == [False, True, False]


def test_a_mission_has_no_measures_of_its_ground(tmp_path: Path) -> None:
    store = RunStore(tmp_path / "runs.jsonl", lambda spec: "d")
    store.add(SPECS[0], replace(RESULT, ground=None))
    assert RunStore(store.file, lambda spec: "d").results[SPECS[0].id].ground is None
    assert json.loads(filled(tmp_path).file.read_text().splitlines()[1])["result"]["ground"]["tortuosity"] == 1.125


def test_what_ended_with_an_error_is_driven_again(tmp_path: Path) -> None:
    store = RunStore(tmp_path / "runs.jsonl", lambda spec: "d")
    store.add(SPECS[0], RunResult("", ERROR, said="MemoryError"))
    again = RunStore(store.file, lambda spec: "d")
    assert again.results == {} and again.torn == again.older == 0
    again.add(SPECS[0], RESULT)
    assert RunStore(store.file, lambda spec: "d").results == {SPECS[0].id: RESULT}


def test_a_file_that_cannot_be_read_is_told(tmp_path: Path) -> None:
    (tmp_path / "runs.jsonl").mkdir()
    with pytest.raises(Exception, match=r"runs\.jsonl: cannot be used"):
        RunStore(tmp_path / "runs.jsonl", lambda spec: "d")
