// The buttons over the map: zoom, fit, follow, which way is up, legend.

import { make, setAttribute, setText } from "viewer/dom.js";
import { icon, setIcon } from "viewer/icons.js";

const STEP = 1.5;

/** Adds the buttons. Returns what keys do the same. */
export function addMapButtons(place, camera, legend) {
  const actions = {
    f: () => camera.setMode(camera.mode === "follow" ? "free" : "follow"),
    0: () => camera.setMode("fit"),
    n: () => camera.setHeadingUp(!camera.headingUp),
    l: () => legend.toggle(),
    Home: () => camera.setMode("fit"),
  };
  const fit = button("fit", "Show everything (0)", actions[0], "All");
  const follow = button("follow", "Follow the rover (F)", actions.f, "Follow");
  const up = button("north", "North or heading up (N)", actions.n, "North");
  const explain = button("legend", "What the signs mean (L)", actions.l, "Legend");
  place.append(
    button("plus", "Zoom in (+)", () => camera.zoom(STEP)),
    button("minus", "Zoom out (−)", () => camera.zoom(1 / STEP)),
    fit,
    follow,
    up,
    explain,
  );
  const refresh = () => {
    setAttribute(fit, "aria-pressed", camera.mode === "fit");
    setAttribute(follow, "aria-pressed", camera.mode === "follow");
    setText(up.lastElementChild, camera.headingUp ? "Ahead" : "North");
    setIcon(up.firstElementChild, camera.headingUp ? "heading" : "north");
    setAttribute(
      up,
      "aria-label",
      camera.headingUp ? "Heading is up; press for north up" : "North is up; press for heading up",
    );
  };
  refresh();
  camera.listeners.add(refresh);
  return actions;
}

function button(sign, name, onclick, word = "") {
  return make(
    "button",
    { class: "square", type: "button", "aria-label": name, title: name, onclick },
    make("span", { class: "holder" }, icon(sign)),
    make("span", { class: "word" }, word),
  );
}
