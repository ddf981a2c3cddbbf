"""The fingerprint by which a saved state knows its mission."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from companion.mission.identity import fingerprint
from companion.mission.load import load_mission
from companion.mission.mission import MissionError
from tests.support.rig import yard


def test_missions_are_the_same_wherever_they_lie_and_different_wherever_they_lead(tmp_path: Path) -> None:
    (tmp_path / "copy").mkdir()
    first, second = yard(tmp_path), yard(tmp_path / "copy")
    assert fingerprint(first) == fingerprint(second)
    assert second.source is not None
    second.source.write_text("# a remark\n" + second.source.read_text())
    assert fingerprint(load_mission(second.source)) == fingerprint(first)
    others = [
        replace(first, targets=(replace(first.targets[0], hold_s=1.0),)),
        replace(first, rover=replace(first.rover, radius_m=0.4)),
        replace(first, prior_map=tmp_path / "yard.png"),
    ]
    assert len({fingerprint(mission) for mission in (first, *others)}) == 4
    with_map = fingerprint(others[2])
    (tmp_path / "yard.png").write_bytes(b"changed")
    assert fingerprint(others[2]) != with_map
    (tmp_path / "yard.png").unlink()
    with pytest.raises(MissionError, match=r"prior_map: .*yard\.png: cannot be read"):
        fingerprint(others[2])
