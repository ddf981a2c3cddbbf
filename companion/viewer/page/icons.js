// The signs of the page as SVG, drawn in a square of 24 units. Fonts differ too much to rely on their symbols.

const SVG = "http://www.w3.org/2000/svg";

// A stroke each; those in FILLED are areas.
const SHAPES = {
  plus: "M12 5V19M5 12H19",
  minus: "M5 12H19",
  fit: "M4 9V4H9M15 4H20V9M20 15V20H15M9 20H4V15",
  follow: "M12 2V7M12 17V22M2 12H7M17 12H22M12 8A4 4 0 1 1 12 16A4 4 0 1 1 12 8Z",
  north: "M12 3L17 20L12 16.5L7 20Z",
  heading: "M12 3L17 20L12 16.5L7 20ZM3 6A11 11 0 0 1 6 3M21 6A11 11 0 0 0 18 3",
  legend: "M9 9A3 3 0 1 1 13.2 11.7C12.4 12.1 12 12.7 12 13.6V14.5M12 18V18.3",
  theme: "M12 3A9 9 0 1 0 12 21ZM12 3A9 9 0 0 1 12 21",
  chart: "M4 4V20H20M7 15L11 10L14 13L19 6",
  close: "M6 6L18 18M18 6L6 18",
  play: "M7 4L20 12L7 20Z",
  pause: "M7 4H10V20H7ZM14 4H17V20H14Z",
  next: "M5 5L14 12L5 19ZM17 5H19V19H17Z",
  previous: "M19 5L10 12L19 19ZM5 5H7V19H5Z",
  skip: "M4 6L11 12L4 18M12 6L19 12L12 18",
  send: "M12 21C12 21 5 14 5 9A7 7 0 0 1 19 9C19 14 12 21 12 21ZM12 6.5A2.5 2.5 0 1 1 12 11.5A2.5 2.5 0 1 1 12 6.5Z",
  driving: "M12 2L21 21L12 16.5L3 21Z",
  waiting: "M7 4H10.5V20H7ZM13.5 4H17V20H13.5Z",
  stopped: "M8 2.5H16L21.5 8V16L16 21.5H8L2.5 16V8Z",
  ended: "M4 12.5L9.5 18L20 6",
  connecting: "M5 12H5.1M12 12H12.1M19 12H19.1",
  offline: "M5 5L19 19M19 5L5 19",
  error: "M6 6L18 18M18 6L6 18",
  warning: "M12 4L21.5 20H2.5ZM12 10V14.5M12 17.3V17.5",
  notice: "M12 7A5 5 0 1 1 12 17A5 5 0 1 1 12 7Z",
  info: "M12 10.5V18M12 6V6.2",
  good: "M4 12.5L9.5 18L20 6",
  pending: "M12 6A6 6 0 1 1 12 18A6 6 0 1 1 12 6Z",
  now: "M5 4L20 12L5 20Z",
  target: "M12 5A7 7 0 1 1 12 19A7 7 0 1 1 12 5ZM12 11V13",
};
const FILLED = new Set(["play", "pause", "next", "previous", "driving", "waiting", "stopped", "notice", "now"]);

/** A sign by name. It is decoration: what it means must stand beside it or in an aria-label. */
export function icon(name) {
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("viewBox", "0 0 24 24");
  svg.setAttribute("class", FILLED.has(name) ? "icon filled" : "icon");
  svg.setAttribute("aria-hidden", "true");
  const path = document.createElementNS(SVG, "path");
  path.setAttribute("d", SHAPES[name] ?? SHAPES.info);
  svg.append(path);
  svg.dataset.name = name;
  return svg;
}

/** Shows another sign in a place that holds one; does nothing when it is there already. */
export function setIcon(place, name) {
  if (place.firstElementChild?.dataset.name !== name) place.replaceChildren(icon(name));
}
