// Says what the colours and signs of the map mean, and which keys there are.

import { make } from "viewer/dom.js";
import { icon } from "viewer/icons.js";

const AREAS = [
  ["free", "seen free"],
  ["obstacle", "obstacle"],
  ["unknown", "not seen yet"],
  ["closed", "closed by fence or mission"],
  ["costly", "possible, but costs more"],
];
const LINES = [
  ["rover", "rover; its tip shows where it heads"],
  ["path", "path that is left"],
  ["motion", "planned motion"],
  ["setpoint", "what the autopilot was told"],
  ["track", "way driven, by speed"],
  ["ray", "what the sensor sees"],
  ["fence", "fence; strokes on the closed side"],
  ["mover", "moving thing, with where it will be in 2 s"],
  ["goal", "where the rover goes now"],
  ["done", "target reached"],
  ["failed", "target not reached"],
  ["touched", "contact: the rover touched something"],
];
/** What a simulator shows: its own world, in which nothing is unknown and nobody plans. */
const TRUE_AREAS = [
  ["free", "free ground"],
  ["obstacle", "obstacle, shut door"],
  ["closed", "open door"],
  ["costly", "slippery or rough ground"],
];
const TRUE_LINES = [
  ["rover", "rover; its tip shows where it heads"],
  ["track", "way driven, by speed"],
  ["ray", "what the sensor reaches"],
  ["fence", "fence of the autopilot; strokes on the closed side"],
  ["mover", "moving thing, with where it will be in 2 s"],
  ["goal", "where the autopilot drives to"],
  ["touched", "contact: the rover touched something"],
];
const KEYS = "Keys: + − zoom, 0 all, F follow, N north or heading up, T light or dark, L legend";

export class Legend {
  constructor(more = "") {
    this.rows = make("ul");
    this.signs = [];
    this.node = make(
      "div",
      { class: "legend", hidden: true, role: "dialog", "aria-label": "What the signs mean" },
      make(
        "button",
        { class: "square plain", type: "button", "aria-label": "Close", onclick: () => this.toggle() },
        icon("close"),
      ),
      make("h2", {}, "What the map shows"),
      this.rows,
      (this.keys = make("p", { class: "keys" }, KEYS + more)),
    );
    this.fill(AREAS, LINES);
  }

  fill(areas, lines) {
    const row = ([name, text]) => make("li", {}, make("span", { class: `swatch ${name}` }), text);
    this.rows.replaceChildren(...[...areas, ...lines, ...this.signs].map(row));
  }

  /** Says what is on the map of a companion, or on that of a simulator. */
  show(scene) {
    if (!scene || this.truth === scene.truth) return;
    this.truth = scene.truth;
    this.fill(...(scene.truth ? [TRUE_AREAS, TRUE_LINES] : [AREAS, LINES]));
  }

  /** Adds a sign that only one of the pages has. */
  addSign(name, text) {
    this.signs.push([name, text]);
    this.fill(AREAS, LINES);
  }

  /** Adds keys that only one of the pages has. */
  addKeys(text) {
    this.keys.append(text);
  }

  close() {
    this.node.hidden = true;
  }

  toggle() {
    this.node.hidden = !this.node.hidden;
  }
}
