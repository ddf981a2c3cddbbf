// The decisions of a record: a list, and for the chosen one why it was made and what else was possible.

import { make, setAttribute, setText } from "viewer/dom.js";
import { lastNotAbove } from "viewer/geometry.js";
import { clock, number } from "viewer/words.js";

/** So many rows around the current one are in the page; a long drive has thousands of decisions. */
const ROWS = 120;

const WHY =
  "Proposals are not chosen themselves. The search answers with one of them: with the genetic curve, unless the " +
  "graph's path, made smooth, costs less along its curve. What it answers with is compared with the current path by cost.";

export class Decisions {
  constructor(record, jump) {
    Object.assign(this, { record, jump, current: -1, hovered: null, from: -1, rows: [] });
    this.changed = () => {};
    this.head = make("h2");
    this.why = make("div", { class: "why-decision" });
    this.list = make("ol", { class: "decision-list" });
    this.only = make("input", { type: "checkbox", onchange: () => this.filter() });
    const only = make("label", { class: "decision-filter" }, this.only, "Hide those that just go on");
    this.node = make("div", { class: "decisions" }, this.why, make("section", {}, this.head, only, this.list));
    setText(this.head, `${record.decisions.length} decisions`);
    this.listed = record.decisions.map((_, i) => i);
  }

  /** Lists all decisions, or those with which the rover does not just go on as before. */
  filter() {
    const all = this.record.decisions.map((_, i) => i);
    this.listed = this.only.checked ? all.filter((i) => !this.record.decisions[i].goes_on) : all;
    const shown = this.only.checked ? `${this.listed.length} of ${all.length}` : all.length;
    setText(this.head, `${shown} decisions`);
    this.from = -1;
    this.showList();
  }

  /** The decision that is valid at a time. */
  at(t) {
    return this.record.decisions[(this.current = lastNotAbove(this.record.decisionTimes, t))] ?? null;
  }

  /** Goes to the decision before or after a time. */
  step(t, direction) {
    const times = this.listed.map((i) => this.record.decisionTimes[i]);
    const at = lastNotAbove(times, t);
    // In the middle of a decision, back means its beginning, as everywhere where something is played.
    const back = at >= 0 && t - times[at] > 0.05 ? at : at - 1;
    const wanted = times[direction > 0 ? at + 1 : back];
    if (wanted !== undefined) this.jump(wanted);
  }

  show(t) {
    const decision = this.at(t);
    if (decision === this.shown && this.built) return;
    [this.shown, this.built, this.hovered] = [decision, true, null];
    this.why.replaceChildren(
      ...(decision ? this.explain(decision) : [make("p", { class: "nothing" }, "No decision yet.")]),
    );
    this.showList();
  }

  explain(decision) {
    const scene = this.record.scene;
    return [
      make("h2", {}, `Decision ${decision.number}: ${decision.action}`),
      make("p", {}, `${clock(decision.t, scene)} · to ${decision.target || "no target"} · part ${decision.part}`),
      make("p", { class: "reason" }, decision.reason),
      this.candidates(decision.candidates ?? []),
      this.inWords(decision.lines ?? []),
    ];
  }

  /** Map, candidates and costs as lines, as `replay --why` prints them; what was opened once stays open. */
  inWords(lines) {
    const list = make("ul", { class: "lines" }, ...lines.map((line) => make("li", {}, line)));
    return make(
      "details",
      { open: this.opened ? "" : null, ontoggle: (event) => (this.opened = event.target.open) },
      make("summary", {}, "In words, and what the cost is made of"),
      list,
    );
  }

  candidates(candidates) {
    if (!candidates.length) return make("p", { class: "nothing" }, "Nothing else was weighed.");
    const row = (one, i) =>
      make(
        "tr",
        {
          class: one.taken ? "taken" : null,
          onmouseenter: () => this.hover(i),
          onmouseleave: () => this.hover(null),
        },
        make("td", {}, make("span", { class: "letter" }, letter(i))),
        make("td", { class: one.part ? "proposal" : null }, one.name, make("div", { class: "note" }, one.note ?? "")),
        make("td", { class: "right" }, costText(one.cost)),
        make("td", { class: "right" }, costText(one.along)),
        make("td", {}, one.taken ? "taken" : ""),
      );
    const head = ["", "candidate", "cost", "curve", ""].map((name) => make("th", {}, name));
    const table = make(
      "table",
      { class: "candidates" },
      make("thead", {}, make("tr", {}, ...head)),
      make("tbody", {}, ...candidates.map(row)),
    );
    return make("div", {}, table, ...(candidates.some((one) => one.part) ? [make("p", { class: "nothing" }, WHY)] : []));
  }

  hover(index) {
    this.hovered = index;
    this.changed();
  }

  showList() {
    const { listed } = this;
    const current = lastNotAbove(listed, this.current); // in the list: the one in force, or the last before it
    const from = Math.max(0, Math.min(current - ROWS / 2, listed.length - ROWS));
    if (from !== this.from) {
      this.from = from;
      this.rows = listed.slice(from, from + ROWS).map((i) => this.row(this.record.decisions[i]));
      this.list.replaceChildren(
        ...this.more(from, "earlier", from - 1),
        ...this.rows,
        ...this.more(listed.length - from - this.rows.length, "later", from + this.rows.length),
      );
    }
    const inForce = listed[current] === this.current; // not one that is hidden
    this.rows.forEach((row, i) => setAttribute(row, "aria-current", inForce && from + i === current ? "true" : null));
    const row = this.rows[current - from];
    this.list.scrollTop = row ? row.offsetTop - this.list.offsetTop - this.list.clientHeight / 2 : 0;
  }

  /** What is not in the list, as a button that goes there. */
  more(count, when, next) {
    if (count <= 0) return [];
    const go = () => this.jump(this.record.decisionTimes[this.listed[next]]);
    const text = `${count} ${when} ${count === 1 ? "decision" : "decisions"}`;
    return [make("li", {}, make("button", { type: "button", class: "more", onclick: go }, text))];
  }

  /** Goes to a decision whose row was pressed, and shows its why: on a phone it stands far above the list. */
  choose(decision) {
    this.jump(decision.t);
    this.why.scrollIntoView({ block: "start" });
  }

  row(decision) {
    return make(
      "li",
      {},
      make(
        "button",
        { type: "button", onclick: () => this.choose(decision) },
        make("time", {}, clock(decision.t, this.record.scene)),
        make("b", {}, decision.number),
        make("span", {}, `${decision.action}: ${decision.reason}`),
      ),
    );
  }

  /** The candidates on the map; the one taken is strong, the one under the mouse, too. */
  drawLines(pen) {
    for (const i of this.order()) this.drawLine(pen, this.shown.candidates[i], i);
  }

  drawCosts(pen) {
    // The one taken has the first choice.
    for (const i of this.order().reverse()) this.drawCost(pen, this.shown.candidates[i], i);
  }

  order() {
    const candidates = this.shown?.candidates ?? [];
    return candidates.map((_, i) => i).sort((a, b) => candidates[a].taken - candidates[b].taken);
  }

  drawLine(pen, { cells, curve, taken }, i) {
    const strong = taken || i === this.hovered;
    const [width, casing] = strong ? [6, 4] : [2.5, 2];
    pen.line(curve ?? cells ?? [], { colour: colourOf(pen, i), width, dash: taken ? [] : [7, 5], casing });
  }

  drawCost(pen, { cells, curve, taken, cost }, i) {
    const line = curve ?? cells ?? [];
    if (!line.length) return;
    const strong = taken || i === this.hovered;
    const [x, y] = pen.camera.toScreen(...line[Math.min(line.length - 1, Math.ceil(line.length * 0.6))]);
    const text = `${letter(i)} ${Number.isFinite(cost) ? number(cost, 1) : "–"}${taken ? " taken" : ""}`;
    const [size, weight] = strong ? [15, 800] : [13, 650];
    pen.label(text, x, y, 9, { size, weight, colour: colourOf(pen, i) });
  }
}

function costText(cost) {
  return Number.isFinite(cost) ? number(cost, 2) : "–";
}

function colourOf(pen, index) {
  return pen.colours.others[index % pen.colours.others.length];
}

function letter(index) {
  return String.fromCharCode(97 + (index % 26));
}
