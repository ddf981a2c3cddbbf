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

from sitl.campaign.campaign_file import CampaignTable, load_campaign
from sitl.campaign.run_spec import RunResult, specs_of
from sitl.campaign.run_store import RunStore, digest_of

TABLE = CampaignTable(name="c", worlds=["clutter", "yard"], runs=3)
SPECS = list(specs_of(TABLE))
RESULT = RunResult("points", "reached", 1, 1, seconds=31.25, metres=40.1, said="said", dwelt=((1, 2, 3),))


def filled(folder: Path, digest: str = "d") -> RunStore:
    store = RunStore(folder / "runs.jsonl", digest)
    for number, spec in enumerate(SPECS):
        store.add(spec, replace(RESULT, seconds=30.0 + number))
    return store


def test_what_was_kept_is_there_again_and_counts_once(tmp_path: Path) -> None:
    store = filled(tmp_path)
    store.add(SPECS[0], replace(RESULT, seconds=99.0))
    again = RunStore(store.file, "d")
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
        again = RunStore(store.file, "d")
        assert again.results.items() <= store.results.items()
        again.add(SPECS[-1], store.results[SPECS[-1].id])
        assert SPECS[-1].id in RunStore(store.file, "d").results, "a torn line takes no other with it"
    finally:
        shutil.rmtree(folder)


def test_lines_of_other_code_do_not_count_and_a_changed_line_is_noticed(tmp_path: Path) -> None:
    store = filled(tmp_path)
    other = RunStore(store.file, "other")
    assert other.results == {} and other.older == len(SPECS)
    lines = store.file.read_text().splitlines()
    lines[2] = lines[2].replace('"touched":0', '"touched":1')
    store.file.write_text("\n".join(lines) + "\n")
    again = RunStore(store.file, "d")
    assert again.torn == 1 and len(again.results) == len(SPECS) - 1
    assert json.loads(lines[0])["id"] == SPECS[0].id


def test_another_mission_under_the_same_name_is_another_campaign(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text('worlds = ["m.toml"]')
    digests = []
    for east_m in (2.0, 3.0, 2.0):
        (tmp_path / "m.toml").write_text(f"[[target]]\nnorth_m = 1.0\neast_m = {east_m}\n")
        digests.append(digest_of(load_campaign(tmp_path / "c.toml"), tmp_path))
    assert digests[0] == digests[2] != digests[1]


def test_a_file_that_cannot_be_read_is_told(tmp_path: Path) -> None:
    (tmp_path / "runs.jsonl").mkdir()
    with pytest.raises(Exception, match=r"runs\.jsonl: cannot be read"):
        RunStore(tmp_path / "runs.jsonl", "d")
