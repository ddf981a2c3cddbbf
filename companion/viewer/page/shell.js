// The parts of the page and where they stand; the same for a live run and a record.

import { theme } from "viewer/colours.js";
import { Headline } from "viewer/headline.js";
import { make } from "viewer/dom.js";
import { icon } from "viewer/icons.js";
import { Legend } from "viewer/legend.js";
import { addMapButtons } from "viewer/map_buttons.js";

const BAR_MARGIN_PX = 20;

/** Builds the page into `root`. Returns its places, to be filled by others. */
export function buildShell(root, camera) {
  const canvas = make("canvas", {
    class: "map",
    tabindex: 0,
    role: "img",
    "aria-label": "Map. Drag to move, wheel or two fingers to zoom, arrow keys to move, plus and minus to zoom.",
  });
  const headline = new Headline();
  const legend = new Legend();
  const buttons = make("div", { class: "map-buttons", role: "toolbar", "aria-label": "Map" });
  const bar = make("div", { class: "bar" });
  const stage = make(
    "main",
    { class: "stage" },
    canvas,
    make("div", { class: "veil", "aria-hidden": "true" }),
    buttons,
    legend.node,
    bar,
  );
  const strip = make("section", { class: "strip", "aria-label": "Over time" });
  const charts = make("section", { class: "charts", "aria-label": "Figures over time" });
  const panel = make("aside", { class: "panel", "aria-label": "Details" });
  const viewer = make("div", { class: "viewer" }, headline.node, stage, strip, charts, panel);
  root.replaceChildren(viewer);
  const keys = addMapButtons(buttons, camera, legend);
  const themed = make(
    "button",
    {
      class: "square plain",
      type: "button",
      "aria-label": "Light or dark (T)",
      title: "Light or dark (T)",
      onclick: () => theme.toggle(),
    },
    icon("theme"),
  );
  headline.node.append(themed);
  keys.t = () => theme.toggle();
  keys.Escape = () => legend.close();
  return { viewer, canvas, headline, legend, buttons, bar, strip, charts, panel, keys };
}

/** Keeps the map's own marks clear of what covers its edges. */
export function watchEdges({ bar, buttons, legend }, view) {
  const measure = () => {
    // Only what stays: a map that moves for each message would be hard to read.
    view.camera.covered = bar.childElementCount ? bar.lastElementChild.offsetHeight + BAR_MARGIN_PX : 0;
    buttons.style.bottom = `${view.camera.covered}px`;
    legend.node.style.maxHeight = `calc(100% - ${view.camera.covered + 24}px)`;
    // Their box may be wider than its columns, which stand at its right edge.
    const boxOf = (one) => [one.offsetLeft, one.offsetTop, one.offsetWidth, one.offsetHeight];
    const [x, y] = boxOf(buttons);
    view.taken = [...buttons.children].map(boxOf).map(([left, top, ...size]) => [x + left, y + top, ...size]);
    const lefts = [...buttons.children].map((button) => button.offsetLeft);
    // One button or two in a column of their own, in a corner, leave the map beside them free.
    const full = lefts.filter((one) => lefts.filter((other) => other === one).length > 2);
    const left = Math.min(...(full.length ? full : lefts));
    view.camera.coveredRight = buttons.offsetWidth - left + 12;
    view.invalidate();
  };
  const observer = new ResizeObserver(measure);
  observer.observe(bar);
  observer.observe(buttons);
}
