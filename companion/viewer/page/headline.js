// The one large line: what the rover does, or why it stands. Its colour and its sign are the state.

import { make, setAttribute, setText } from "viewer/dom.js";
import { setIcon } from "viewer/icons.js";
import { distance, wayLeft } from "viewer/geometry.js";
import { heading, metres, namedClock, number, sentence } from "viewer/words.js";

/** A line of more letters than this is written smaller. */
const LONG = 40;
/** A rover that is slower turns on the spot if it turns faster than that. */
const STANDS_M_S = 0.05;
const TURNS_RAD_S = 0.1;
const SIGNS = new Set(["driving", "waiting", "stopped", "ended", "connecting"]);

export class Headline {
  constructor() {
    this.sign = make("span", { class: "sign", "aria-hidden": "true" });
    this.state = make("span", { class: "state" });
    this.line = make("h1", { class: "line" });
    // Read out apart from the line, because the line may hold seconds that count.
    this.spoken = make("span", { class: "spoken", role: "status" });
    this.why = make("p", { class: "why" });
    this.mission = make("span", { class: "mission" });
    this.clock = make("span", { class: "clock" });
    this.badge = make("span", { class: "badge" });
    this.node = make(
      "header",
      { class: "headline" },
      this.sign,
      make("div", { class: "words" }, this.line, this.why, this.spoken),
      (this.about = make("div", { class: "about" }, this.mission, make("span", { class: "when" }, this.badge, this.clock))),
    );
    this.show(null, null);
  }

  /** Shows scene and frame. `trouble`, a text, stands instead of the rover's own line when data is not fresh; `open`: the page is connected. */
  show(scene, frame, trouble = "", open = false) {
    const state = trouble ? "offline" : SIGNS.has(frame?.state) ? frame.state : "connecting";
    setAttribute(this.node, "data-state", state);
    setIcon(this.sign, state === "ended" && !isGood(frame) ? "error" : state);
    const touched = state === "ended" ? touches(frame) : "";
    const line = trouble || sentence(frame?.line) + touched || (open ? "Waiting for the run to begin" : "Connecting");
    setText(this.line, line);
    setAttribute(this.line, "data-long", line.length > LONG ? "" : null);
    setText(this.spoken, trouble ? trouble.replace(/ for \d.*/, "") : (frame?.line ?? ""));
    setText(this.why, trouble ? lastKnown(frame) : reason(frame, state, scene));
    this.about.hidden = !scene && !frame; // nothing in it
    setText(this.mission, scene?.mission ?? "");
    setText(this.badge, scene ? badge(scene, state === "ended", trouble, open) : "");
    setText(this.clock, frame ? namedClock(frame.t, scene) : "");
    // A report keeps the title of its file.
    if (scene && scene.live !== false)
      document.title = `${trouble || frame?.line || "connecting"} · ${scene?.mission ?? "rover"}`;
  }
}

function badge(scene, ended, trouble, open) {
  const recorded = scene.cut ? "record, cut short" : "record";
  const source = scene.live ? (ended ? "ended" : liveness(trouble, open)) : recorded;
  const kind = scene.truth ? "simulator" : scene.simulated ? "simulated" : "";
  return [source, kind].filter(Boolean).join(", ");
}

function liveness(trouble, open) {
  if (!open) return "not connected";
  return trouble ? "not live" : "live";
}

function lastKnown(frame) {
  return frame?.line ? `Last known: ${frame.line}` : "";
}

function isGood(frame) {
  return reached(frame) === (frame.statuses?.length ?? 0) && !(frame.contacts > 0);
}

// What only a simulator knows.
function touches({ contacts }) {
  if (!(contacts > 0)) return "";
  return contacts === 1 ? ", touched something" : `, touched something ${contacts} times`;
}

function reached({ statuses = [] }) {
  return statuses.filter((status) => status === "reached").length;
}

// While driving, or making way, the second line says how far it still is, after why it hurries home; when standing it
// says why; in the end, what it came to.
function reason(frame, state, scene) {
  if (!frame) return "";
  if (state === "ended") return cameTo(frame, scene?.targets ?? []);
  if (state !== "driving" && !frame.makes_way) return sentence(frame.why);
  return [sentence(frame.why), onTheWay(frame)].filter(Boolean).join(" · ");
}

// Where targets are missed the large line counts them, and `why` names them.
function cameTo(frame, targets) {
  const all = frame.statuses?.length ?? 0;
  const count = all ? `${reached(frame)} of ${all} targets reached` : "";
  if (!frame.why) return count;
  if (targets.some(({ name }) => frame.why.startsWith(`${name}:`))) return frame.why; // names stay as they are
  return all && reached(frame) === all ? `${count} · ${sentence(frame.why)}` : sentence(frame.why);
}

function onTheWay(frame) {
  if (!frame.goal || !frame.pose) return "";
  const rest = wayLeft(frame);
  const way = Number.isFinite(rest)
    ? `${metres(rest)} to go`
    : `${metres(distance(frame.pose, frame.goal.place))} as the crow flies`;
  const turning = turningOnTheSpot(frame);
  return turning ? `${turning} · ${way}` : `${way} · ${number(Math.abs(frame.speed ?? NaN))} m/s`;
}

// Where a rover that turns without getting on turns to; empty for one that drives.
function turningOnTheSpot({ setpoint, pose, speed, turn }) {
  if (setpoint?.kind === "heading") return `Turning to ${heading(setpoint.heading)}`;
  if (!(Math.abs(speed) < STANDS_M_S && Math.abs(turn) > TURNS_RAD_S)) return "";
  if (setpoint?.kind !== "position") return `Turning ${turn > 0 ? "right" : "left"}`;
  const [north, east] = setpoint.place;
  return `Turning to ${heading(Math.atan2(east - pose[1], north - pose[0]))}`;
}
