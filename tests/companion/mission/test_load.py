"""A mission file that is not there."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.mission.load import load_mission
from companion.mission.mission import MissionError


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("yard", "yard: no such file; check the path (yard.toml is there)"),
        ("rooms", "rooms: no such file; check the path (missions/rooms.toml is there)"),
        ("garden", "garden: no such file; check the path"),
        ("yard.plan", "yard.plan: no such file; check the path"),
    ],
)
def test_a_name_without_its_suffix_or_folder_is_understood(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, says: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "missions").mkdir()
    for file in ("yard.toml", "missions/rooms.toml"):
        (tmp_path / file).touch()
    with pytest.raises(MissionError) as refused:
        load_mission(Path(name))
    assert str(refused.value) == says
