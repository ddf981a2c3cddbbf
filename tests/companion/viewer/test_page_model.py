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
