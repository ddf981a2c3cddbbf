// The panel beside the map: large numbers, news, targets, facts.

import { make, setAttribute, setText } from "viewer/dom.js";
import { facts, OF_PLACE, readouts, trueFacts } from "viewer/facts.js";
import { distance, wayLeft } from "viewer/geometry.js";
import { setIcon } from "viewer/icons.js";
import { kindOf } from "viewer/layer_marks.js";
import { NewsList } from "viewer/news.js";
import { metres } from "viewer/words.js";

const MOST_TARGETS = 200;

export class Panel {
  /** `go(place)` shows a place on the map; `jump(t)`, of a report, goes to a time. */
  constructor(model, { go, jump }) {
    this.model = model;
    this.go = go;
    this.numbers = [0, 1, 2].map(() => readout());
    this.targetsHead = make("h2", {}, "Targets");
    this.targets = make("ol", { class: "targets" });
    // A goal that somebody has asked for while the mission was under way: it comes before the targets.
    this.asked = make("p", { class: "asked", hidden: true });
    this.news = new NewsList(model, jump);
    this.rows = [];
    this.facts = make("dl", { class: "facts" });
    this.node = make(
      "div",
      { class: "sections" },
      make("div", { class: "readouts" }, ...this.numbers.map((each) => each.node)),
      // What is new is seen without scrolling, however many targets there are.
      make("section", { class: "news-section" }, make("h2", {}, "News"), this.news.node),
      (this.targetsSection = make("section", { class: "targets-section" }, this.targetsHead, this.asked, this.targets)),
      make("section", { class: "facts-section" }, (this.factsHead = make("h2")), this.facts),
    );
  }

  show() {
    const { frame, scene } = this.model;
    const told = readouts(frame);
    this.numbers.forEach((number, i) => {
      number.node.hidden = i >= told.length;
      if (i < told.length) number.set(...told[i]);
    });
    setText(this.factsHead, frame?.state === "ended" ? "Facts, as of the end" : "Facts");
    this.showFacts(scene?.truth ? trueFacts(frame) : facts(frame));
    this.showTargets();
    this.news.show();
  }

  showFacts(list) {
    while (this.rows.length < list.length) this.rows.push(this.addFact());
    list.forEach(([name, value, level], i) => {
      setText(this.rows[i].name, name);
      setText(this.rows[i].value, value);
      setAttribute(this.rows[i].row, "data-level", level);
      setAttribute(this.rows[i].row, "data-place", OF_PLACE.has(name) ? "" : null);
      setIcon(this.rows[i].sign, level ?? "good");
    });
    while (this.rows.length > list.length) this.rows.pop().row.remove(); // a link that has gone
  }

  addFact() {
    const [name, value, sign] = [make("dt"), make("dd"), make("span", { class: "fact-sign", "aria-hidden": "true" })];
    const row = make("div", { class: "fact" }, name, value, sign);
    this.facts.append(row);
    return { row, name, value, sign };
  }

  showTargets() {
    const { scene, frame } = this.model;
    const targets = (scene?.targets ?? []).slice(0, MOST_TARGETS);
    const key = JSON.stringify([scene?.targets?.length, targets.map((target) => [target.name, target.place])]);
    if (key !== this.targetsKey) this.buildTargets(targets, key);
    const ended = frame?.state === "ended";
    const reached = (frame?.statuses ?? []).filter((status) => status === "reached").length;
    let seen = false;
    targets.forEach((target, i) => {
      const status = frame?.statuses?.[i] ?? "pending";
      const open = status === "pending" || status === "waiting";
      const now = !ended && !seen && open && frame?.goal?.name === target.name;
      seen ||= now;
      const row = this.targetRows[i];
      setAttribute(row.node, "data-kind", now ? "now" : kindOf(status));
      setIcon(row.sign, now ? "now" : ({ skipped: "skip" }[kindOf(status)] ?? kindOf(status)));
      const ahead = status === "waiting" ? "waiting" : frame?.state === "driving" ? "going there" : "next";
      const missed = ended && status === "pending" ? "not reached" : status;
      setText(row.status, now ? ahead : scene.truth ? "" : missed); // a simulator does not know what became of them
      setText(row.far, frame?.pose && open ? metres(farTo(frame, target, now)) : "");
    });
    const known = `Targets, ${reached} of ${scene?.targets?.length} reached`;
    const first = frame?.goal?.asked === true && !ended;
    this.asked.hidden = !first;
    setText(this.asked, first ? `First, as asked: ${frame.goal.name}` : "");
    this.targetsSection.hidden = scene?.truth === true && !targets.length;
    const head = scene?.truth ? "Targets of the mission" : known;
    setText(this.targetsHead, targets.length ? head : unplaced(frame?.statuses?.length ?? 0));
  }

  buildTargets(targets, key) {
    this.targetsKey = key;
    this.targetRows = targets.map((target, i) => {
      const [sign, status, far] = ["target-sign", "target-status", "target-far"].map((name) =>
        make("span", { class: name }),
      );
      const button = make(
        "button",
        { type: "button", class: "target", title: "Show on the map", onclick: () => this.go(target.place) },
        sign,
        make("span", { class: "target-name" }, `${i + 1}. ${target.name}`),
        make("span", { class: "target-state" }, status, far),
      );
      return { node: make("li", {}, button), sign, status, far };
    });
    const left = (this.model.scene?.targets?.length ?? 0) - targets.length;
    this.targets.replaceChildren(
      ...this.targetRows.map((row) => row.node),
      ...(left > 0 ? [make("li", { class: "nothing" }, `${left} more are not listed; the map shows them.`)] : []),
    );
  }
}

// Along the path, where the rover follows one there; else straight.
function farTo(frame, target, now) {
  const along = now ? wayLeft(frame) : NaN;
  return Number.isFinite(along) ? along : distance(frame.pose, target.place);
}

// Before the rover knows where it is, nobody knows where the targets are.
function unplaced(count) {
  if (!count) return "No targets";
  return count === 1 ? "1 target, its place is not known yet" : `${count} targets, their places are not known yet`;
}

function readout() {
  const [name, value, unit] = ["readout-name", "readout-value", "readout-unit"].map((each) =>
    make("span", { class: each }),
  );
  const set = (nameText, valueText, unitText) => {
    setText(name, nameText);
    setText(value, valueText);
    setText(unit, unitText);
    setAttribute(value, "data-long", String(valueText).length > 5 ? "" : null);
  };
  return {
    node: make("div", { class: "readout" }, name, make("span", { class: "readout-line" }, value, " ", unit)),
    set,
  };
}
