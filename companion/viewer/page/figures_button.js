// The button that shows and hides the figures over time. On a large screen they are seen from the start.

import { make } from "viewer/dom.js";
import { icon } from "viewer/icons.js";

const ROOM = "(min-width: 900px) and (min-height: 620px)";

export function addFiguresButton({ buttons, viewer, legend, keys }) {
  const name = "Figures over time (G)";
  const set = (on) => {
    viewer.classList.toggle("with-charts", on);
    button.setAttribute("aria-pressed", on);
  };
  keys.g = () => set(!viewer.classList.contains("with-charts"));
  const button = make(
    "button",
    { class: "square", type: "button", "aria-label": name, title: name, onclick: keys.g },
    make("span", { class: "holder" }, icon("chart")),
    make("span", { class: "word" }, "Figures"),
  );
  buttons.append(button);
  legend.addKeys(", G figures");
  set(matchMedia(ROOM).matches);
}
