"""What the page tells in words: what a list leaves out, and what is waited for before there is a map."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.page_script import needs_node, ran

pytestmark = needs_node

DOCUMENT = """
globalThis.Path2D = class {};
globalThis.matchMedia = () => ({ matches: false, addEventListener() {} });
globalThis.localStorage = { getItem: () => null, setItem() {} };
class Element {
  constructor(text = "") {
    Object.assign(this, { children: [], text, attributes: {}, dataset: {}, style: { setProperty() {} } });
  }
  put(nodes) {
    return nodes.map((one) => {
      const node = one instanceof Element ? one : new Element(String(one));
      node.parent = this;
      return node;
    });
  }
  append(...nodes) { this.children.push(...this.put(nodes)); }
  prepend(...nodes) { this.children.unshift(...this.put(nodes)); }
  replaceChildren(...nodes) { this.children = this.put(nodes); }
  remove() { if (this.parent) this.parent.children = this.parent.children.filter((one) => one !== this); }
  setAttribute(name, value) { this.attributes[name] = value; }
  getAttribute(name) { return this.attributes[name] ?? null; }
  hasAttribute(name) { return name in this.attributes; }
  removeAttribute(name) { delete this.attributes[name]; }
  scrollIntoView() {}
  addEventListener(name, call) { this[`on${name}`] = call; }
  get childElementCount() { return this.children.length; }
  get firstElementChild() { return this.children[0]; }
  get lastElementChild() { return this.children.at(-1); }
  get textContent() { return this.text + this.children.map((one) => one.textContent).join(""); }
  set textContent(text) { Object.assign(this, { children: [], text }); }
}
globalThis.document = {
  createElement: () => new Element(), createElementNS: () => new Element(), documentElement: new Element(),
};
const texts = (node) => node.children.map((one) => one.textContent);
"""


def test_the_news_say_how_many_older_ones_are_not_listed(tmp_path: Path) -> None:
    script = """
const { NewsList } = await import("./news.js");
const news = (count) => Array.from({ length: count }, (_, i) => ({ t: i, level: "info", text: `no. ${i}` }));
const model = { news: news(400), newsCount: 400, scene: {} };
const list = new NewsList(model);
const seen = [];
const look = () => (list.show(), seen.push([list.node.childElementCount, list.node.lastElementChild.textContent]));
look();
model.news = [...model.news, ...news(600).slice(400)].slice(-500);
model.newsCount = 600;
look();
model.news = [...model.news, { t: 600, level: "info", text: "the newest" }].slice(-500);
model.newsCount = 601;
look();
tell([seen, list.node.firstElementChild.textContent]);
"""
    seen, newest = ran(tmp_path, DOCUMENT + script)
    assert seen[0][0] == 400 and "no. 0" in seen[0][1]
    assert seen[1:] == [[501, "100 older ones are not listed."], [501, "101 older ones are not listed."]]
    assert "the newest" in newest


def test_targets_and_decisions_that_are_not_listed_are_told(tmp_path: Path) -> None:
    script = """
const { Decisions } = await import("./decisions.js");
const { Panel } = await import("./panel.js");
const targets = Array.from({ length: 250 }, (_, i) => ({ name: `t${i}`, place: [i, 0] }));
const frame = { statuses: targets.map(() => "reached"), state: "ended" };
const panel = new Panel({ scene: { targets }, frame, news: [], newsCount: 0 }, {});
panel.showTargets();
const times = Array.from({ length: 300 }, (_, i) => i);
const decisions = times.map((t) => ({ t, number: t + 1, action: "follow", reason: "" }));
let to = null;
const list = new Decisions({ decisions, decisionTimes: times, scene: {} }, (t) => { to = t; });
list.show(150);
const rows = list.list.children;
const current = rows.filter((row) => row.attributes["aria-current"]).map((row) => row.textContent);
rows.at(-1).children[0].onclick();
tell([panel.targetsHead.textContent, texts(panel.targets).at(-1), rows.length, texts(list.list), current, to]);
"""
    head, last, rows, lines, current, to = ran(tmp_path, DOCUMENT + script)
    assert head == "Targets, 250 of 250 reached" and last == "50 more are not listed; the map shows them."
    assert (rows, lines[0], lines[-1], to) == (122, "90 earlier decisions", "90 later decisions", 210)
    assert len(current) == 1 and "151" in current[0]


def test_all_on_the_map_shows_the_last_target_fences_and_other_records(tmp_path: Path) -> None:
    script = """
const { MapView } = await import("./map_view.js");
const { Others } = await import("./overlays.js");
const targets = Array.from({ length: 1000 }, (_, i) => ({ name: "", place: [i, -i] }));
const borders = [{ corners: [[-90, 0], [1500, 0], [0, 1]] }];
const path = Array.from({ length: 1000 }, (_, i) => [0, 2 * i]);
const others = new Others([{ name: "b", track: [[0, -50, 0], [1, -70, 0]], elsewhere: false }], 0, () => {});
const model = {
  scene: { targets, borders, home: [0, 0] }, frame: { path }, track: { bounds: () => null }, map: { bounds: () => [] },
};
const places = MapView.prototype.interest.call({ model, besides: [() => others.places()] });
const [norths, easts] = [0, 1].map((axis) => places.map((place) => place[axis]));
tell([Math.min(...norths), Math.max(...norths), Math.min(...easts), Math.max(...easts)]);
"""
    assert ran(tmp_path, DOCUMENT + script) == [-90, 1500, -999, 1998]


def test_before_the_autopilot_is_heard_the_page_says_what_it_waits_for(tmp_path: Path) -> None:
    script = """
const { Headline } = await import("./headline.js");
const { drawNothingYet } = await import("./layer_frame.js");
const headline = new Headline();
const frame = { state: "connecting", line: "waiting for the autopilot's heartbeat on udpin:0.0.0.0:14550", t: 1 };
const heads = [[null, false], [null, true], [frame, true]].map(([moment, open]) => {
  headline.show(null, moment, "", open);
  return headline.line.textContent;
});
const drawn = (model) => {
  const texts = [];
  const context = { beginPath() {}, roundRect() {}, fill() {} };
  const camera = { width: 400, height: 300, coveredRight: 60, covered: 0 };
  const pen = { context, camera, colours: {}, widthOf: () => 100, text: (text) => texts.push(text) };
  drawNothingYet(pen, { map: {}, scene: {}, ...model });
  return texts;
};
const placed = [{ frame: { pose: [0, 0, 0] } }, { frame, map: { shape: {} } }];
tell([heads, drawn({ frame }), drawn({ frame: { state: "ended" } }), ...placed.map(drawn)]);
"""
    heads, before, ended, placed, mapped = ran(tmp_path, DOCUMENT + script)
    assert heads[:2] == ["Connecting", "Waiting for the run to begin"]
    assert heads[2] == "Waiting for the autopilot's heartbeat on udpin:0.0.0.0:14550"
    assert before == ["The rover's place is not known yet", "The map begins with it"] and placed == mapped == []
    assert ended == ["The rover's place was never known"]


def test_the_map_says_where_the_rover_is_not_known_or_no_position_comes(tmp_path: Path) -> None:
    script = """
const { drawPlaceNote } = await import("./layer_frame.js");
const drawn = (frame, scene = { home: [0, 0] }) => {
  const texts = [];
  const context = { beginPath() {}, roundRect() {}, fill() {} };
  const camera = { width: 400, height: 300, coveredRight: 60, covered: 0 };
  const pen = { context, camera, colours: {}, widthOf: () => 100, text: (text) => texts.push(text) };
  drawPlaceNote(pen, { frame, map: {}, scene });
  return texts.join();
};
const pose = [0, 0, 0];
const [fresh, old] = [0.1, 9].map((age) => ({ pose, rates: { position_age_s: age } }));
tell([drawn({}), drawn({ state: "ended" }), drawn(old), drawn(fresh), drawn({}, {}), drawn(old, { truth: true })]);
"""
    unknown, never, last, *nothing = ran(tmp_path, DOCUMENT + script)
    assert (unknown, never) == ("The rover's place is not known yet", "The rover's place was never known")
    assert last == "Last known place: no position comes" and nothing == ["", "", ""]


def test_only_what_is_fresh_is_called_live(tmp_path: Path) -> None:
    script = """
const { Headline } = await import("./headline.js");
const headline = new Headline();
const [drives, ended] = [{ state: "driving", t: 1 }, { state: "ended", t: 2 }];
const [run, simulator, record] = [{ live: true }, { live: true, truth: true }, { live: false }];
const shown = [
  [run, drives, "", true], [run, drives, "No connection for 3 s", false],
  [run, drives, "Not connected: a token is needed", false], [run, drives, "No data for 3 s", true],
  [run, ended, "", false], [simulator, drives, "", true], [simulator, drives, "No connection for 3 s", false],
  [simulator, ended, "", false], [record, drives, "", false],
];
tell(shown.map((one) => (headline.show(...one), headline.badge.textContent)));
"""
    badges = ran(tmp_path, DOCUMENT + script)
    assert badges[:5] == ["live", "not connected", "not connected", "not live", "ended"]
    assert badges[5:] == ["live, simulator", "not connected, simulator", "ended, simulator", "record"]


def test_a_rover_that_turns_on_the_spot_does_not_just_drive_with_no_speed(tmp_path: Path) -> None:
    script = """
const { Headline } = await import("./headline.js");
const headline = new Headline();
const frame = { state: "driving", t: 1, pose: [0, 0, 0], goal: { name: "X", place: [0, 12] }, speed: 0.01, turn: 0.5 };
const moments = [
  { setpoint: { kind: "heading", heading: 0.9076 } }, { setpoint: { kind: "position", place: [3, 3] } },
  { setpoint: { kind: "velocity", speed: 0, turn: -0.5 }, turn: -0.5 }, { speed: 0.8 }, { turn: 0 },
];
tell(moments.map((one) => (headline.show({ live: true }, { ...frame, ...one }, "", true), headline.why.textContent)));
"""
    turning, driving = ["Turning to 052°", "Turning to 045°", "Turning left"], ["0.8 m/s", "0.0 m/s"]
    far = "12.0 m as the crow flies"
    whole = [f"{one} · {far}" for one in turning] + [f"{far} · {one}" for one in driving]
    assert ran(tmp_path, DOCUMENT + script) == whole


def test_why_a_rover_drives_otherwise_is_told_beside_how_far_it_is(tmp_path: Path) -> None:
    script = """
const { Headline } = await import("./headline.js");
const headline = new Headline();
const frame = {
  state: "driving", t: 1, pose: [0, 0, 0], goal: { name: "home", place: [0, 12] }, speed: 0, why: "battery at 18 %",
};
const moments = [{ setpoint: { kind: "heading", heading: -0.14 } }, { goal: null }, { state: "stopped" }];
tell(moments.map((one) => (headline.show({ live: true }, { ...frame, ...one }, "", true), headline.why.textContent)));
"""
    turns, without, stopped = ran(tmp_path, DOCUMENT + script)
    assert turns == "Battery at 18 % · Turning to 352° · 12.0 m as the crow flies"
    assert without == stopped == "Battery at 18 %"


def test_what_holds_up_a_rover_that_is_led_is_marked_on_the_timeline(tmp_path: Path) -> None:
    script = """
globalThis.Path2D = class {};
const { Record } = await import("./record.js");
const frames = ["", "stuck", "stuck", "", "stuck"].map((held, t) => (
  { t, state: "driving", line: held || "driving", held_up: held, pose: [t, 0, 0] }
));
tell(new Record({ scene: {}, frames }).events.map((one) => [one.t, one.kind, one.text, one.place]));
"""
    assert ran(tmp_path, script) == [[1, "stop", "stuck", [1, 0]], [4, "stop", "stuck", [4, 0]]]


def test_a_stay_at_a_target_is_not_marked_as_a_stop(tmp_path: Path) -> None:
    script = """
globalThis.Path2D = class {};
const { Record } = await import("./record.js");
const scene = { targets: [{ name: "a", place: [0, 0] }, { name: "b", place: [9, 0] }] };
const moments = [["driving", "pending"], ["waiting", "reached"], ["driving", "reached"], ["waiting", "reached"]];
const frames = moments.map(([state, status], t) => (
  { t, state, line: state, pose: [t, 0, 0], statuses: [status, "pending"], goal: { name: t < 2 ? "a" : "b" } }
));
tell(new Record({ scene, frames }).events.map((one) => [one.t, one.kind]));
"""
    assert ran(tmp_path, script) == [[1, "good"], [3, "stop"]]


def test_a_target_that_is_tried_again_is_shown_as_waiting_and_then_as_under_way(tmp_path: Path) -> None:
    script = """
const { Panel } = await import("./panel.js");
const scene = { targets: [{ name: "a", place: [0, 5] }, { name: "b", place: [0, 9] }] };
const frame = { pose: [0, 0, 0], goal: { name: "a", place: [0, 5] } };
const moments = [["waiting", "waiting"], ["driving", "pending"], ["ended", "unreachable"]];
tell(moments.map(([state, status]) => {
  const model = { scene, frame: { ...frame, state, statuses: [status, "pending"] }, news: [], newsCount: 0 };
  const panel = new Panel(model, {});
  panel.showTargets();
  const { node, status: told, far } = panel.targetRows[0];
  return [node.attributes["data-kind"], told.textContent, far.textContent];
}));
"""
    waiting, driving, ended = ran(tmp_path, DOCUMENT + script)
    assert waiting == ["now", "waiting", "5.0 m"] and driving == ["now", "going there", "5.0 m"]
    assert ended == ["error", "unreachable", ""]


def test_the_facts_of_a_run_that_has_ended_are_named_so(tmp_path: Path) -> None:
    script = """
const { Panel } = await import("./panel.js");
const model = { scene: { targets: [] }, frame: { state: "driving" }, news: [], newsCount: 0 };
const panel = new Panel(model, {});
const shown = () => panel.numbers.filter((one) => !one.node.hidden).length;
const look = () => (panel.show(), [panel.factsHead.textContent, shown()]);
const before = look();
model.frame = { state: "ended" };
tell([before, look()]);
"""
    assert ran(tmp_path, DOCUMENT + script) == [["Facts", 3], ["Facts, as of the end", 1]]


def test_the_mark_of_a_pilot_who_took_over_is_not_called_a_stop(tmp_path: Path) -> None:
    script = """
globalThis.Path2D = class {};
const { Record } = await import("./record.js");
const frames = [["driving", "companion"], ["waiting", "pilot"], ["driving", "companion"], ["stopped", "nobody"]].map(
  ([state, drives], t) => ({ t, state, drives, line: state, pose: [t, 0, 0] })
);
tell(new Record({ scene: {}, frames }).events.map((one) => [one.t, one.name]));
"""
    assert ran(tmp_path, script) == [[1, "taken over"], [3, "stop"]]


def test_a_button_that_would_do_nothing_is_locked_and_says_why(tmp_path: Path) -> None:
    script = """
const { locks } = await import("./actions.js");
const drives = { state: "driving", drives: "companion", goal: { name: "X" }, paused: false };
tell([
  [drives, true], [drives, false], [{ ...drives, state: "ended" }, true], [{ ...drives, goal: null }, true],
  [{ ...drives, drives: "nobody", paused: true }, true], [null, true], [{ ...drives, paused: true }, true, true],
].map((one) => locks(...one)));
"""
    driving, lost, ended, without, paused, nothing, old = ran(tmp_path, DOCUMENT + script)
    assert driving == {"pause": "", "resume": "Not paused here", "skip": "", "goto": ""}
    assert set(lost.values()) == {"Not connected"} and set(ended.values()) == {"The run has ended"}
    assert without["skip"] == without["goto"] != "" and without["pause"] == ""
    assert paused == {"pause": "", "resume": "", "skip": "", "goto": "Only while the companion drives"}
    assert old == {"pause": "", **dict.fromkeys(("resume", "skip", "goto"), "No data: what is shown here is old")}
    assert nothing["pause"] == "" and all(nothing[name] for name in ("resume", "skip", "goto"))


def test_the_token_is_kept_for_the_tab_and_taken_out_of_the_address(tmp_path: Path) -> None:
    script = """
const kept = {};
globalThis.sessionStorage = { getItem: (name) => kept[name] ?? null, setItem: (name, text) => { kept[name] = text; } };
globalThis.location = { hash: "#token=a%2Bb", pathname: "/page", search: "?x=1" };
const shown = [];
globalThis.history = { replaceState: (state, title, address) => { shown.push(address); location.hash = ""; } };
const { findToken } = await import("./token.js");
tell([findToken(), findToken(), shown]);
"""
    assert ran(tmp_path, DOCUMENT + script) == ["a+b", "a+b", ["/page?x=1"]]


def test_a_locked_button_that_is_pressed_says_why_and_does_nothing(tmp_path: Path) -> None:
    script = """
const { Actions } = await import("./actions.js");
globalThis.setTimeout = () => {};
const sent = [];
const model = { frame: { state: "driving", drives: "companion", goal: { name: "X" }, paused: false, t: 1 } };
const view = { above: [], invalidate() {} };
const stage = { classList: { add() {}, remove() {} } };
const actions = new Actions(new Element(), stage, model, view, { send: (one) => sent.push(one.action) });
const { resume, pause } = actions.byAction;
const press = (button) => (button.onclick(), actions.toast.textContent);
actions.show({ may_act: true }, true);
const locked = press(resume);
model.frame.paused = true;
actions.show({ may_act: true }, true);
tell([locked, resume.getAttribute("aria-disabled"), press(resume), press(pause), sent]);
"""
    locked, freed, pressed, paused, sent = ran(tmp_path, DOCUMENT + script)
    assert (locked, freed) == ("Go on: not paused here", None)
    assert (pressed, paused, sent) == ("Go on: sent", "Pause: sent", ["resume", "pause"])


def test_distances_are_named_for_what_they_are_and_a_run_that_has_ended_has_no_speed(tmp_path: Path) -> None:
    script = """
const { readouts } = await import("./facts.js");
const frame = { pose: [0, 0, 0], goal: { name: "X", place: [0, 12] }, path: [], speed: 0.4, state: "driving" };
const path = [[0, 0], [5, 0], [5, 12], [0, 12]];
const moments = [
  {}, { path }, { state: "ended" }, { state: "ended", goal: null }, { goal: null }, { goal: null, driven_m: 88.34 },
];
tell(moments.map((one) => readouts({ ...frame, ...one }).slice(0, 2).map((each) => each.join(" "))));
"""
    straight, along, ended, home, without, simulator = ran(tmp_path, DOCUMENT + script)
    assert straight == ["speed 0.4 m/s", "straight 12.0 m"] and along[1] == "along path 22.0 m"
    assert (without[1], simulator[1]) == ("to goal – ", "driven 88.3 m")
    assert ended == ["straight 12.0 m", "mode – "] and home == ["mode – "]


def test_a_link_without_positions_is_not_called_good(tmp_path: Path) -> None:
    script = """
const { facts } = await import("./facts.js");
const ages = [[0.4, 0.1], [0.4, 9], [4, 9], [9, 9], [Infinity, null]];
tell(ages.map(([heartbeat_age_s, position_age_s]) => {
  const frame = { state: "stopped", rates: { heartbeat_age_s, position_age_s }, figures: { latency_ms: 12 } };
  return facts(frame).find(([name]) => name === "Link").slice(1);
}));
"""
    good, lost, old, silent, none = ran(tmp_path, script)
    assert good == ["good, 12 ms", None] and lost == ["heartbeats, but no position", "warning"]
    assert old[1] == "warning" and silent[1] == "error" and none == ["no heartbeat yet", "warning"]


def test_above_a_figure_stands_its_value_of_now_and_none_after_the_end(tmp_path: Path) -> None:
    script = """
const { writeFileSync } = await import("node:fs");
writeFileSync("./uplot.js", "export default class {}");
const { valueOf } = await import("./charts.js");
const { KINDS } = await import("./figures.js");
const of = (...given) => valueOf(KINDS[0], ...given);
tell([
  of({ speed: -0.01 }), of({ speed: -0.52 }), of({ speed: 0.4, state: "ended" }), of({ state: "ended" }, 0.4),
  of({ speed: 0.4 }, null), of(null),
]);
"""
    assert ran(tmp_path, DOCUMENT + script) == ["0.0 m/s", "0.5 m/s", "–", "0.4 m/s", "–", "–"]


def test_a_simulator_lists_the_targets_of_the_mission_without_saying_what_became_of_them(tmp_path: Path) -> None:
    script = """
const { Panel } = await import("./panel.js");
const shown = [[{ name: "gate", place: [0, 3] }], []].map((targets) => {
  const scene = { truth: true, targets };
  const panel = new Panel({ scene, frame: { statuses: [], pose: [0, 0, 0] }, news: [], newsCount: 0 }, {});
  panel.showTargets();
  return [panel.targetsSection.hidden, panel.targetsHead.textContent, panel.targets.textContent];
});
tell(shown);
"""
    listed, none = ran(tmp_path, DOCUMENT + script)
    assert listed == [False, "Targets of the mission", "1. gate3.0 m"] and none[0] is True


def test_marks_that_would_cover_each_other_are_smaller(tmp_path: Path) -> None:
    script = """
const { radii } = await import("./layer_marks.js");
tell(radii([[100, 50], [0, 0], [116, 50], [100, 50.5], [100, 200], [110, 218]]));
"""
    assert ran(tmp_path, DOCUMENT + script) == [6, 12, 7, 6, pytest.approx(9.3, abs=0.1), pytest.approx(9.3, abs=0.1)]


@pytest.mark.parametrize(("width", "covered_right"), [(360, 66), (390, 123), (900, 70)])
def test_scale_and_colours_of_the_track_lie_where_no_button_is(tmp_path: Path, width: int, covered_right: int) -> None:
    script = """
const { drawFrame } = await import("./layer_frame.js");
const plates = [];
const context = new Proxy({}, {
  get: (_, name) => (...given) => { if (name === "roundRect") plates.push(given.slice(0, 4)); },
  set: () => true,
});
const camera = { width: WIDTH, height: 400, coveredRight: COVERED, covered: 0, scale: 20, up: 0 };
const nothing = () => {};
const pen = { context, camera, colours: { speeds: Array(5) }, widthOf: () => 45, text: nothing, stroke: nothing };
drawFrame({ ...pen, disc: nothing }, { track: { points: [1, 2], topSpeed: 1.5 } });
tell(plates);
"""
    scale, colours = ran(tmp_path, script.replace("WIDTH", str(width)).replace("COVERED", str(covered_right)))
    for left, _, wide, _ in (scale, colours):
        assert left >= 0 and left + wide <= width - covered_right
    beside = scale[0] + scale[2] <= colours[0]
    assert beside if width - covered_right > 300 else colours[1] + colours[3] <= scale[1]


def test_in_the_end_it_says_what_the_run_came_to_and_how_the_rover_is_left(tmp_path: Path) -> None:
    script = """
const { Headline } = await import("./headline.js");
const headline = new Headline();
const armed = "the rover was left armed, in HOLD";
const moments = [
  { statuses: ["reached", "reached"], line: "done", why: armed },
  { statuses: ["reached", "reached"], line: "done", why: "" },
  { statuses: ["reached", "pending"], line: "ended: 1 of 2 targets reached", why: "b: not reached" },
];
const show = (one) => (headline.show({ live: true }, { state: "ended", t: 1, ...one }), headline.why.textContent);
tell(moments.map(show));
"""
    assert ran(tmp_path, DOCUMENT + script) == [
        "2 of 2 targets reached · The rover was left armed, in HOLD",
        "2 of 2 targets reached",
        "B: not reached",
    ]


def test_a_drive_that_touched_something_says_so_in_its_large_line_and_its_news(tmp_path: Path) -> None:
    script = """
globalThis.matchMedia = () => ({ matches: false, addEventListener() {} });
const { Headline } = await import("./headline.js");
const { Record } = await import("./record.js");
const headline = new Headline();
const moments = [0, 1, 3, null].map((contacts) => ({ contacts }));
moments.push({ contacts: 3, state: "driving" });
const lines = moments.map((one) => {
  headline.show({ live: false }, { state: "ended", t: 1, line: "done", statuses: ["reached"], ...one });
  return headline.line.textContent;
});
const later = { t: 2, level: "info", text: "later" };
const frames = [0, 1, 2].map((t) => ({ t, state: "driving", news: t === 2 ? [later] : [] }));
const record = new Record({ scene: {}, frames, contacts: [{ t: 1, what: "an obstacle", place: [0, 0] }] });
tell([lines, record.news.map((one) => [one.t, one.level, one.text]), record.events.map((one) => one.kind)]);
"""
    lines, news, kinds = ran(tmp_path, DOCUMENT + script)
    touched = ["Done", "Done, touched something", "Done, touched something 3 times"]
    assert lines == [*touched, "Done", "Done"]
    assert news == [[1, "error", "Contact: an obstacle"], [2, "info", "later"]] and kinds == ["contact"]


def test_decisions_with_which_the_rover_just_goes_on_can_be_left_out(tmp_path: Path) -> None:
    script = """
const { Decisions } = await import("./decisions.js");
const times = Array.from({ length: 400 }, (_, i) => i);
const decisions = times.map((t) => ({ t, number: t + 1, action: "follow", reason: "", goes_on: t % 20 !== 0 }));
let to = null;
const list = new Decisions({ decisions, decisionTimes: times, scene: {} }, (t) => { to = t; });
list.show(150);
list.only.checked = true;
list.only.onchange();
const rows = list.list.children;
const current = rows.filter((row) => row.attributes["aria-current"]).map((row) => row.textContent);
rows[3].children[0].onclick();
const [few, head, jumped] = [rows.length, list.head.textContent, to];
list.step(150, -1);
const before = to;
list.step(150, 1);
const after = to;
list.show(160);
const chosen = list.list.children.filter((row) => row.attributes["aria-current"]).map((row) => row.textContent);
list.only.checked = false;
list.only.onchange();
tell([few, head, current, jumped, before, after, chosen, list.list.children.length, list.head.textContent]);
"""
    few, head, current, jumped, before, after, chosen, rows, whole = ran(tmp_path, DOCUMENT + script)
    assert (few, head, rows, whole) == (20, "20 of 400 decisions", 122, "400 decisions")
    assert current == [], "the one in force is hidden"
    assert (jumped, before, after) == (60, 140, 160) and len(chosen) == 1 and "161" in chosen[0]


def test_what_is_left_of_a_path_that_is_a_second_old_is_counted_from_where_the_rover_is(tmp_path: Path) -> None:
    script = """
const { pathAhead, wayLeft } = await import("./geometry.js");
const path = Array.from({ length: 41 }, (_, i) => [0, 0.5 * i]);
const goal = { place: [0, 20] };
const at = (east, north = 0) => ({ pose: [north, east, 0], path, goal });
const back = [...path, ...path.map(([, e]) => [1, 20 - e])]; // and back beside itself
tell([
  [0, 0.2, 1.1, 2.4].map((east) => wayLeft(at(east))),
  wayLeft({ pose: [0.6, 2, 0], path: back, goal: { place: [1, 0] } }),
  pathAhead({ pose: [0, 20, 0], path: path.slice(35) }).length, pathAhead({ path }).length,
  pathAhead({ pose: [0, 0, 0] }),
]);
"""
    left, beside, at_end, without_pose, without_path = ran(tmp_path, DOCUMENT + script)
    assert left == pytest.approx([20.0, 19.8, 18.9, 17.6], abs=0.01)
    assert beside == pytest.approx(39.6, abs=0.1), "the near part of the path counts, not a later one"
    assert (at_end, without_pose, without_path) == (1, 41, [])


def test_a_frame_says_itself_how_old_it_is(tmp_path: Path) -> None:
    script = """
const { silence, isLost } = await import("./freshness.js");
const at = (heartbeat, position, state = "driving") =>
  ({ state, rates: { heartbeat_age_s: heartbeat, position_age_s: position } });
const all = [null, {}, at(1, 0.2), at(5, 5), at(1, 2), at(9, 9, "ended")];
tell([all.map(silence), all.map((frame) => Boolean(isLost(frame)))]);
"""
    silent, lost = ran(tmp_path, DOCUMENT + script)
    assert silent == ["", "", "", "Autopilot silent for 5 s", "", ""]
    assert lost == [False, False, False, True, True, False]


def test_the_track_of_another_record_is_broken_where_its_position_jumps(tmp_path: Path) -> None:
    script = """
const { unbroken } = await import("./overlays.js");
tell([unbroken([[0, 0, 0], [0.4, 1, 0], [60, 2, 0], [60.4, 30, 0], [61, 31, 0]]), unbroken([])]);
"""
    lines, none = ran(tmp_path, DOCUMENT + script)
    assert lines == [[[0, 0], [1, 0], [2, 0]], [[30, 0], [31, 0]]] and none == []
