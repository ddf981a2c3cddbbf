// All colours of the page, for light and dark, and the switch between them.
//
// Warm colours are the rover and what lies ahead of it, cool colours are the past. State and level never depend on a
// colour alone: each has a sign, too. Readable in the sun: texts have a contrast of 4.5 or more with their ground, the
// large line 7, lines on the map 3 with the ground or with their casing (test_page_contrast.py). The CSS takes its
// colours from here, so canvas and page cannot differ.

const LIGHT = {
  page: "#eef1f4",
  panel: "#ffffff",
  raised: "#ffffff",
  text: "#0d1319",
  soft: "#36414c",
  line: "#b9c2cb",
  accent: "#0b5cad",
  unknown: "#9fa9b3",
  free: "#ffffff",
  obstacle: "#12181e",
  closed: "#e9c9dc",
  closedLine: "#b97ba3",
  costly: "#f2e3b3",
  grid: "rgba(20, 40, 60, 0.13)",
  fence: "#8e2a6b",
  halo: "#ffffff",
  ink: "#0d1319",
  rover: "#cc4200",
  roverEdge: "#1a0a00",
  path: "#cc4200",
  motion: "#a3005c",
  setpoint: "#a3005c",
  goal: "#cc4200",
  goalText: "#ffffff",
  ray: "rgba(0, 90, 170, 0.13)",
  rayEnd: "rgba(0, 80, 160, 0.65)",
  mover: "#6a3fc0",
  home: "#0d1319",
  done: "#00665a",
  failed: "#a8200d",
  doubt: "#b87500",
  pending: "#ffffff",
  future: "rgba(20, 40, 60, 0.4)",
  casing: "rgba(255, 255, 255, 0.9)",
  speeds: ["#5a1e8c", "#3b4fa3", "#1f7a94", "#149a76", "#4a9a20"],
  others: ["#8a5a00", "#0072b2", "#b0407f", "#00806a", "#5f6b00"],
};

const DARK = {
  page: "#0a0d10",
  panel: "#13181d",
  raised: "#1d242b",
  text: "#f4f7f9",
  soft: "#c9d2da",
  line: "#3d4853",
  accent: "#79bdff",
  unknown: "#101418",
  free: "#4b5864",
  obstacle: "#f3f6f8",
  closed: "#4f2b45",
  closedLine: "#d896c2",
  costly: "#4a4329",
  grid: "rgba(210, 230, 250, 0.10)",
  fence: "#f08cc8",
  halo: "#0a0d10",
  ink: "#f4f7f9",
  rover: "#ff7a33",
  roverEdge: "#fff3ea",
  path: "#ff8a47",
  motion: "#ff6fc0",
  setpoint: "#ff6fc0",
  goal: "#ff7a33",
  goalText: "#1a0a00",
  ray: "rgba(120, 190, 255, 0.13)",
  rayEnd: "rgba(140, 200, 255, 0.7)",
  mover: "#bda0ff",
  home: "#f4f7f9",
  done: "#39d0b4",
  failed: "#ff7b66",
  doubt: "#ffc531",
  pending: "#13181d",
  future: "rgba(210, 230, 250, 0.4)",
  casing: "rgba(10, 13, 16, 0.9)",
  speeds: ["#b98af0", "#8a9df5", "#59bfd9", "#45dca8", "#e2ec4e"],
  others: ["#ffc46b", "#7cc4ff", "#ff9ccb", "#6fe3c8", "#d3de62"],
};

/** What the page calls them; the same in light and dark, because they are large areas with their own text colour. */
const STATES = {
  driving: ["#0a56a3", "#ffffff"],
  waiting: ["#ffc531", "#161000"],
  stopped: ["#a81f0b", "#ffffff"],
  ended: ["#33414e", "#ffffff"],
  connecting: ["#33414e", "#ffffff"],
  offline: ["#000000", "#ffffff"],
};

/** Levels of news and facts: text colours for light and dark. */
const LEVELS = {
  light: { error: "#a8200d", warning: "#7a4b00", notice: "#0b5cad", info: "#36414c", good: "#00665a" },
  dark: { error: "#ff8a77", warning: "#ffc531", notice: "#79bdff", info: "#c9d2da", good: "#39d0b4" },
};

const KEPT_AS = "viewer-theme";

/** The theme in use. `colours` is what the canvas draws with; listeners hear of every change. */
class Theme {
  constructor() {
    this.listeners = new Set();
    this.system = matchMedia("(prefers-color-scheme: dark)");
    this.system.addEventListener("change", () => this.apply());
    this.chosen = recall();
    this.apply();
  }

  get dark() {
    return this.chosen ? this.chosen === "dark" : this.system.matches;
  }

  toggle() {
    this.chosen = this.dark ? "light" : "dark";
    remember(this.chosen);
    this.apply();
  }

  apply() {
    this.colours = this.dark ? DARK : LIGHT;
    const root = document.documentElement;
    root.dataset.theme = this.dark ? "dark" : "light";
    for (const [name, value] of Object.entries(this.colours)) {
      if (typeof value === "string") root.style.setProperty(`--${name}`, value);
    }
    this.colours.speeds.forEach((value, index) => root.style.setProperty(`--speed-${index}`, value));
    this.colours.others.forEach((value, index) => root.style.setProperty(`--other-${index}`, value));
    for (const [name, value] of Object.entries(LEVELS[this.dark ? "dark" : "light"])) {
      root.style.setProperty(`--${name}`, value);
    }
    for (const [name, [ground, text]] of Object.entries(STATES)) {
      root.style.setProperty(`--state-${name}`, ground);
      root.style.setProperty(`--state-${name}-text`, text);
    }
    for (const tell of this.listeners) tell();
  }
}

// Storage may be forbidden (private windows, some file: pages). The theme is then forgotten, nothing else happens.
function recall() {
  try {
    return localStorage.getItem(KEPT_AS);
  } catch {
    return null;
  }
}

function remember(name) {
  try {
    localStorage.setItem(KEPT_AS, name);
  } catch {
    // see above
  }
}

/** The colours of the states, for the timeline. */
export function stateColour(state) {
  return (STATES[state] ?? STATES.connecting)[0];
}

export const theme = new Theme();
