"""The files that a mission was read from."""

from __future__ import annotations

from pathlib import Path

from companion.mission.mission import HomePoint, Mission, SitlSpec, Target
from companion.mission.serialization import from_json, to_json
from companion.mission.source_files import source_files


def mission(folder: Path) -> Mission:
    for name, text in {
        "m.toml": "",
        "f.plan": "{}",
        "map.yaml": "image: map.pgm",
        "map.pgm": "",
        "w.toml": 'base = "b.map"',
    }.items():
        (folder / name).write_text(text)
    targets = (Target("t", HomePoint(1.0, 2.0)),)
    sitl = SitlSpec(world=folder / "w.toml")
    return Mission(
        "m", targets, prior_map=folder / "map.yaml", sitl=sitl, source=folder / "m.toml", also_read=(folder / "f.plan",)
    )


def test_every_file_that_exists_is_named_once_with_those_that_maps_name(tmp_path: Path) -> None:
    names = [path.name for path in source_files(mission(tmp_path))]
    assert names == ["m.toml", "f.plan", "map.yaml", "map.pgm", "w.toml"]
    (tmp_path / "b.map").touch()
    assert source_files(mission(tmp_path))[-1].name == "b.map"


def test_a_map_that_cannot_be_read_names_nothing(tmp_path: Path) -> None:
    one = mission(tmp_path)
    (tmp_path / "map.yaml").write_bytes(b"image: [\xff")
    assert (tmp_path / "map.pgm") not in source_files(one)


def test_a_mission_comes_back_from_its_json(tmp_path: Path) -> None:
    one = mission(tmp_path)
    assert from_json(to_json(one), "mission.json") == one
