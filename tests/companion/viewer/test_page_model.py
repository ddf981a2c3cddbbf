"""What the page knows after it was away: the rest of the same run, or another run alone."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.page_script import needs_node, ran

pytestmark = needs_node

SCRIPT = """
globalThis.Path2D = class {};
const { Model } = await import("./model.js");
const scene = (run) => ({
  kind: "scene", run, map_epoch: 1, began_unix_s: null, map: null, rover: { cruise_m_s: 1 }, targets: [],
});
const frame = (t, north, news = []) => ({
  kind: "frame", t, pose: [north, 0, 0], speed: 1, state: "driving", figures: {}, statuses: [], news,
});
const model = new Model();
model.connected();
model.take(scene("first"));
for (let t = 0; t <= 20; t++) model.take(frame(t, 100 + t, t ? [] : [{ t: 0, text: "old" }]));
model.connected(); // again, later than the first run lasted
model.take(scene(NEXT));
const frames = [];
for (let t = 0; t < 40; t++) frames.push(frame(t, t));
model.take({ kind: "past", frames, track: [], news: [{ t: 1, text: "new" }] });
model.take(frame(40, 40));
tell([model.track.points.map((point) => point[0]), model.news.map((one) => one.text)]);
"""


@pytest.mark.parametrize("same", [True, False])
def test_a_run_that_is_begun_again_is_not_mixed_with_the_one_before(tmp_path: Path, same: bool) -> None:
    norths_m, news = ran(tmp_path, SCRIPT.replace("NEXT", '"first"' if same else '"second"'))
    if same:
        assert norths_m == [*range(100, 121), *range(21, 41)] and news == ["old", "new"]
    else:
        assert norths_m == list(range(41)) and news == ["new"]


RECORD = """
globalThis.Path2D = class {};
const { Model } = await import("./model.js");
const { Record } = await import("./record.js");
const map = { south_m: 0, west_m: 0, cell_m: 1, columns: 128, rows: 64, tile: 64 };
const tile = (column) => {
  const bytes = [0x54, 0x49, 0x4c, 0x31, column, 0, 0, 0, 128, 0, ...Array(128).fill((1 << 5) | 31)];
  return btoa(String.fromCharCode(...bytes));
};
const frames = [0, 1, 2, 3, 4].map((t) => ({ t, pose: [0, 0, 0], speed: 1, state: "driving", figures: {} }));
const record = new Record({
  scene: { map, rover: {}, targets: [] },
  frames, tiles: [[1, tile(0)], [3, tile(1)]], maps: [[1, map], [3, map]],
});
const model = new Model();
record.fill(model);
const known = () => [0, 1].map((column) => Number(model.map.tiles.get(column)?.some((cell) => cell === 1) ?? false));
tell([0, 2, 4, 2, 0, 4].map((t) => (record.show(model, t), known())));
"""


def test_a_map_that_was_begun_anew_in_the_same_place_shows_nothing_of_the_other_one(tmp_path: Path) -> None:
    """Wherever the slider goes: before the first map, in it, in the second one, and back."""
    assert ran(tmp_path, RECORD) == [[0, 0], [1, 0], [0, 1], [1, 0], [0, 0], [0, 1]]
