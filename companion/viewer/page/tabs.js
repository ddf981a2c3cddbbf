// Tabs: several sheets in one place, one of them seen.

import { make, setAttribute } from "viewer/dom.js";

export class Tabs {
  /** `sheets` are [name, node]; `changed(name)` hears which one is seen. */
  constructor(place, sheets, changed) {
    Object.assign(this, { sheets, changed, chosen: "" });
    this.buttons = sheets.map(([name]) =>
      make("button", { type: "button", role: "tab", onclick: () => this.choose(name) }, name),
    );
    for (const [, node] of sheets) node.setAttribute("role", "tabpanel");
    place.append(make("div", { class: "tabs", role: "tablist" }, ...this.buttons), ...sheets.map(([, node]) => node));
    this.choose(sheets[0][0]);
  }

  choose(wanted) {
    this.chosen = wanted;
    this.sheets.forEach(([name, node], i) => {
      node.hidden = name !== wanted;
      setAttribute(this.buttons[i], "aria-selected", name === wanted);
    });
    this.changed?.(wanted);
  }
}
