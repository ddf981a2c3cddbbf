// The button that shows and hides the figures over time. On a large screen they are seen from the start.

import { make } from "viewer/dom.js";
import { icon } from "viewer/icons.js";

const ROOM = "(min-width: 900px) and (min-height: 620px)";
/** As in the style sheet: a phone on end, on which everything stands below each other. */
const PHONE = "(max-width: 760px) and (min-height: 501px)";

export function addFiguresButton({ buttons, viewer, legend, keys, charts, panel }) {
  const name = "Figures over time (G)";
  const phone = matchMedia(PHONE);
  const set = (on) => {
    viewer.classList.toggle("with-charts", on);
    button.setAttribute("aria-pressed", on);
  };
  keys.g = () => {
    const on = !viewer.classList.contains("with-charts");
    set(on);
    if (on && phone.matches) charts.scrollIntoView();
  };
  const button = make(
    "button",
    { class: "square", type: "button", "aria-label": name, title: name, onclick: keys.g },
    make("span", { class: "holder" }, icon("chart")),
    make("span", { class: "word" }, "Figures"),
  );
  buttons.append(button);
  legend.addKeys(", G figures");
  set(matchMedia(ROOM).matches);
  // On a phone they come last, below the news, and are scrolled with them.
  const settle = () => (phone.matches ? panel : viewer).append(charts);
  phone.addEventListener("change", settle);
  settle();
}
