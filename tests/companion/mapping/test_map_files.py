"""Map files: what is read, where it lies, and what is refused with one line."""

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image

from companion.core.frames import NedPoint
from companion.core.grid import BASE_WEIGHT, OBSTACLE, Grid, empty_grid
from companion.mapping.map_files import MapError, load_map, save_ros_map, save_weighed_map
from tests.support.shared_data import SHARED, needs_shared

YAML = (
    "image: {image}\nresolution: 0.5\norigin: [1.0, -2.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
)


def refusal(path: Path) -> str:
    with pytest.raises(MapError) as caught:
        load_map(path)
    text = str(caught.value)
    assert "\n" not in text
    assert text.startswith(f"{path.parent}")
    return text


def ros_map(folder: Path, pixels: bytes | str, yaml: str = YAML, image: str = "map.pgm") -> Path:
    data = pixels.encode() if isinstance(pixels, str) else pixels
    (folder / image).write_bytes(data)
    path = folder / "map.yaml"
    path.write_text(yaml.format(image=image))
    return path


def test_ros_p5_lies_where_its_origin_says_with_the_top_row_in_the_north(tmp_path: Path) -> None:
    grid = load_map(ros_map(tmp_path, b"P5\n# a comment\n3 2\n255\n" + bytes([0, 254, 205, 254, 254, 254])))
    assert (grid.width, grid.height, grid.resolution_m) == (3, 2, 0.5)
    assert grid.south_west == NedPoint(north_m=-2.0, east_m=1.0)
    assert np.argwhere(grid.weights >= OBSTACLE).tolist() == [[1, 0]]
    assert grid.weights[1, 1] == grid.weights[1, 2] == BASE_WEIGHT


@pytest.mark.parametrize("maxval", [1, 15, 100, 255, 1000, 65535])
def test_p2_and_every_maxval_mean_the_same_as_p5(tmp_path: Path, maxval: int) -> None:
    plain = load_map(ros_map(tmp_path, f"P2\n2 1\n# grey\n{maxval}\n0\n{maxval}\n"))
    kind = ">2B" if maxval < 256 else ">2H"
    binary = load_map(ros_map(tmp_path, f"P5\n2 1\n{maxval}\n".encode() + struct.pack(kind, 0, maxval)))
    assert plain.weights.tolist() == binary.weights.tolist() == [[OBSTACLE, BASE_WEIGHT]]


def test_negate_makes_light_the_obstacle(tmp_path: Path) -> None:
    grid = load_map(ros_map(tmp_path, "P2 2 1 255 0 255", YAML.replace("negate: 0", "negate: 1")))
    assert grid.weights.tolist() == [[BASE_WEIGHT, OBSTACLE]]


def test_thresholds_decide(tmp_path: Path) -> None:
    strict = YAML.replace("0.65", "0.3").replace("0.196", "0.1")
    assert load_map(ros_map(tmp_path, "P2 2 1 100 60 80", strict)).weights.tolist() == [[OBSTACLE, BASE_WEIGHT]]
    assert load_map(ros_map(tmp_path, "P2 2 1 100 60 80")).weights.tolist() == [[BASE_WEIGHT, BASE_WEIGHT]]


def test_scale_mode_gives_doubtful_ground_a_cost(tmp_path: Path) -> None:
    grid = load_map(ros_map(tmp_path, "P2 4 1 1000 1000 700 500 0", YAML + "mode: scale\n"))
    free, doubtful, worse, blocked = grid.weights[0]
    assert free == BASE_WEIGHT < doubtful < worse < OBSTACLE == blocked


def test_raw_mode_holds_per_cent(tmp_path: Path) -> None:
    grid = load_map(ros_map(tmp_path, "P2 4 1 255 0 50 100 255", YAML + "mode: raw\n"))
    assert grid.weights[0].tolist() == pytest.approx([0.5, 0.75, 1.0, 0.5])


def test_plain_picture_dark_is_an_obstacle_and_transparent_is_not(tmp_path: Path) -> None:
    path = tmp_path / "map.png"
    image = Image.new("RGBA", (3, 1), (255, 255, 255, 255))
    image.putpixel((0, 0), (0, 0, 0, 255))
    image.putpixel((1, 0), (0, 0, 0, 0))
    image.save(path)
    grid = load_map(path, 0.25)
    assert grid.resolution_m == 0.25
    assert grid.weights.tolist() == [[OBSTACLE, BASE_WEIGHT, BASE_WEIGHT]]


@pytest.mark.parametrize("mode", ["1", "L", "P", "RGB", "LA", "I;16"])
def test_every_kind_of_png(tmp_path: Path, mode: str) -> None:
    path = tmp_path / "map.png"
    grey = Image.fromarray(np.array([[0, 255]], dtype=np.uint8))
    if mode == "I;16":
        Image.fromarray(np.array([[0, 65535]], dtype=np.uint16)).save(path)
    else:
        grey.convert(mode).save(path)
    assert load_map(path).weights.tolist() == [[OBSTACLE, BASE_WEIGHT]]


def test_movingai_terrain(tmp_path: Path) -> None:
    path = tmp_path / "m.map"
    path.write_bytes(b"type octile\r\nheight 2\r\nwidth 4\r\nmap\r\n.GS@\r\nOTW.\r\n")
    grid = load_map(path, 2.0)
    assert grid.resolution_m == 2.0
    assert (grid.weights >= OBSTACLE).tolist() == [[True, True, True, False], [False, False, False, True]]


@pytest.mark.parametrize(
    ("pixels", "yaml", "place"),
    [
        ("P2 2 1 255 0 255", YAML.replace("[1.0, -2.0, 0.0]", "[1.0, here, 0.0]"), "origin"),
        ("P2 2 1 255 0 255", YAML.replace("[1.0, -2.0, 0.0]", "[1.0]"), "origin"),
        ("P2 2 1 255 0 255", YAML.replace("0.5", "0.0"), "resolution"),
        ("P2 2 1 255 0 255", YAML.replace("0.5", ".nan"), "resolution"),
        ("P2 2 1 255 0 255", YAML.replace("0.5", "1" + "0" * 400), "resolution"),
        ("P2 2 1 255 0 255", YAML.replace("0.65", "0.1"), "thresholds"),
        ("P2 2 1 255 0 255", YAML.replace("negate: 0", "negate: 7"), "negate"),
        ("P2 2 1 255 0 255", YAML + "mode: guess\n", "mode"),
        ("P2 2 1 255 0 255", "image: [", "line 1"),
        ("P2 2 1 255 0 255", "- a\n- b\n", "map_server"),
        ("P2 2 1 255 0 255", "image: gone.pgm\nresolution: 1\norigin: [0, 0, 0]\n", "gone.pgm"),
        ("P2 2 1 255 0 255", "resolution: 1\norigin: [0, 0, 0]\n", "image"),
        ("P2 2 1 255 0", YAML, "picture"),
        ("P2 2 1 255 0 x", YAML, "picture"),
        ("P2 2 1 255 0 300", YAML, "picture"),
        ("P2 2 1 0 0 0", YAML, "picture"),
        ("P5 4 4 255 short", YAML, "picture"),
        ("P5 -4 4 255 short", YAML, ""),
        ("P5 400000 400000 255 short", YAML, "size"),
        ("P5 9000 9000 255 short", YAML, "size: 9000 x 9000"),
        ("P5 0 4 255 ", YAML, ""),
        ("P9 2 1 255 0 255", YAML, "header"),
        ("", YAML, "header"),
    ],
)
def test_bad_ros_maps_get_one_line(tmp_path: Path, pixels: str, yaml: str, place: str) -> None:
    assert place in refusal(ros_map(tmp_path, pixels, yaml))


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("", "header"),
        ("type octile\nheight 2\nwidth 2\nmap\n..\n", "line 6"),
        ("type octile\nheight 1\nwidth 2\nmap\n...\n", "line 5"),
        ("type octile\nheight 1\nwidth 2\nmap\n.x\n", "'x'"),
        ("type octile\nheight two\nwidth 2\nmap\n..\n", "line 2"),
        ("type octile\nheight 100000\nwidth 100000\nmap\n..\n", "size"),
        ("type octile\nheight 99999999999\nwidth 1\nmap\n.\n", "line 2"),
        ("type octile\nwidth 2\nwidth 2\nmap\n..\n..\n", "height"),
        ("type octile\nheight 0\nwidth 2\nmap\n", "no fields"),
    ],
)
def test_bad_movingai_maps_get_one_line(tmp_path: Path, text: str, place: str) -> None:
    path = tmp_path / "bad.map"
    path.write_text(text)
    assert place in refusal(path)


def test_a_png_bomb_is_refused_by_its_header(tmp_path: Path) -> None:
    header = struct.pack(">IIBBBBB", 60_000, 60_000, 8, 0, 0, 0, 0)

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    path = tmp_path / "bomb.png"
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(b"\0")))
    assert "size" in refusal(path)


def test_other_files_are_refused(tmp_path: Path) -> None:
    assert "suffix '.txt'" in refusal(tmp_path / "map.txt")
    assert "is a folder, not a map" in refusal(tmp_path)
    assert "no such file" in refusal(tmp_path / "gone.png")
    assert "cannot be read" in refusal(tmp_path / "gone.map")
    assert "cannot be read" in refusal(tmp_path / "gone.yaml")
    with pytest.raises(MapError, match="resolution"):
        load_map(tmp_path / "gone.png", 0.0)


def test_saving_tells_unknown_from_free(tmp_path: Path) -> None:
    weights = np.full((2, 3), BASE_WEIGHT)
    weights[0, 1] = OBSTACLE
    known = np.array([[True, False, True], [False, True, True]])
    save_ros_map(Grid(weights, 0.25, NedPoint(-3.5, 7.0)), tmp_path / "lab.v2", known)
    assert np.asarray(Image.open(tmp_path / "lab.v2.pgm")).tolist() == [[205, 254, 254], [254, 0, 254]]
    again = load_map(tmp_path / "lab.v2.yaml")
    assert (again.resolution_m, again.south_west) == (0.25, NedPoint(-3.5, 7.0))
    assert np.array_equal(again.weights, weights)


def test_a_full_disk_leaves_no_half_map_and_the_one_before(tmp_path: Path) -> None:
    grid = Grid(np.ones((3, 4), np.float32), 0.5, NedPoint(0.0, 0.0))
    save_ros_map(grid, tmp_path / "before")
    files = {path: path.read_bytes() for path in tmp_path.iterdir()}
    for name in ("before", "map"):
        (tmp_path / f"{name}.pgm.new").symlink_to("/dev/full")
        with pytest.raises(MapError, match=r"\.pgm: cannot be written: No space left on device; "):
            save_ros_map(grid, tmp_path / name)
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == files


def test_a_map_that_cannot_be_saved_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(MapError, match="cannot be written"):
        save_ros_map(empty_grid(2, 2), tmp_path / "gone" / "map")


TURNED = {"map_server_tests/testmap.yaml", "map_server_tests/testmap2.yaml", "nav2/testmap.yaml"}


@needs_shared
def test_real_ros_maps() -> None:
    folder = SHARED / "data" / "ros_maps"
    obstacles = {}
    for path in sorted(folder.rglob("*.yaml")):
        name = path.relative_to(folder).as_posix()
        grid = load_map(path)
        if name in TURNED:
            plain = load_map(path.parent / yaml.safe_load(path.read_text())["image"])
            assert (grid.weights >= OBSTACLE).sum() > (plain.weights >= OBSTACLE).sum() > 0
            continue
        assert 0.0 < (grid.weights >= OBSTACLE).mean() < 0.5
        obstacles[name] = int((grid.weights >= OBSTACLE).sum())
    assert obstacles["nav2/TenByTen.yaml"] == 20
    assert load_map(folder / "turtlebot3" / "map.yaml").south_west == NedPoint(-10.0, -10.0)
    same = [load_map(folder / "nav2" / f"testmap.{suffix}").weights for suffix in ("pgm", "png", "bmp")]
    assert np.array_equal(same[0], same[1]) and np.array_equal(same[0], same[2])


@needs_shared
def test_real_movingai_maps() -> None:
    for path in sorted((SHARED / "data" / "movingai").rglob("*.map")):
        grid = load_map(path)
        rows = path.read_text().splitlines()[4:]
        blocked = sum(row.count(letter) for row in rows for letter in "@OTW")
        assert int((grid.weights >= OBSTACLE).sum()) == blocked
        assert (grid.weights[-1, 0] >= OBSTACLE) == (rows[0][0] in "@OTW")


def test_a_weighed_map_keeps_obstacles_and_weights_in_place(tmp_path: Path) -> None:
    weights = np.array([[0.5, 0.73, 0.97], [1.0, 0.0, 0.994]])
    save_weighed_map(Grid(weights, 0.25, NedPoint(-3.5, 7.0)), tmp_path / "why-1-map")
    read = load_map(tmp_path / "why-1-map.yaml")
    assert np.allclose(read.weights, [[0.5, 0.73, 0.97], [1.0, 0.5, 0.994]], atol=1e-4)
    assert (read.resolution_m, read.south_west) == (0.25, NedPoint(-3.5, 7.0))
