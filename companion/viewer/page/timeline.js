// The slider of a report with its buttons. Above the slider stand the events; its ground shows the states.

import { stateColour, theme } from "viewer/colours.js";
import { make, setAttribute, setText } from "viewer/dom.js";
import { icon, setIcon } from "viewer/icons.js";
import { SPEEDS } from "viewer/playback.js";
import { clock, elapsed, namedClock } from "viewer/words.js";

const LANE = 26;
const BAND = 10;
const REACH_PX = 12;
/** The slider's knob is as wide as this on both sides of its middle. */
const PAD = 10;
/** Later kinds are drawn above and win a click. */
const ORDER = ["warning", "stop", "given-up", "good", "error", "contact"];

export class Timeline {
  /** `step(direction)` goes to the decision before or after. */
  constructor(place, record, playback, step) {
    Object.assign(this, { record, playback });
    const button = (sign, name, onclick) =>
      make("button", { class: "square", type: "button", "aria-label": name, title: name, onclick }, icon(sign));
    this.play = button("play", "Play or pause (Space)", () => playback.toggle());
    this.time = make("output", { class: "time" });
    this.speed = make(
      "select",
      {
        class: "speed",
        "aria-label": "Speed",
        onchange: () => {
          playback.speed = Number(this.speed.value);
        },
      },
      ...SPEEDS.map((speed) => make("option", { value: speed, selected: speed === playback.speed }, `${speed} ×`)),
    );
    this.marks = make("canvas", { class: "marks", "aria-hidden": "true" });
    this.slider = make("input", {
      type: "range",
      class: "slider",
      min: playback.begin,
      max: playback.end,
      step: "any",
      "aria-label": "Time",
      oninput: () => playback.seek(Number(this.slider.value)),
    });
    this.event = make("p", { class: "event", "aria-live": "off" });
    place.append(
      make(
        "div",
        { class: "timeline" },
        button("previous", "Decision before ([)", () => step(-1)),
        this.play,
        button("next", "Decision after (])", () => step(1)),
        make("div", { class: "lane" }, this.marks, this.slider),
        make("div", { class: "times" }, this.time, this.speed),
      ),
      this.event,
    );
    this.listen();
  }

  listen() {
    new ResizeObserver(() => this.draw()).observe(this.marks);
    theme.listeners.add(() => this.draw());
    this.marks.addEventListener("pointermove", (event) => this.hover(event));
    this.marks.addEventListener("pointerleave", () => this.tellEvent(null));
    this.marks.addEventListener("click", (event) => {
      const found = this.near(event.offsetX);
      this.playback.seek(found ? found.t : this.timeAt(event.offsetX));
      this.tellEvent(found);
    });
  }

  show() {
    const { playback, record } = this;
    if (document.activeElement !== this.slider || Number(this.slider.value) !== playback.t)
      this.slider.value = playback.t;
    setAttribute(this.slider, "aria-valuetext", elapsed(playback.t));
    const day = Number.isFinite(record.scene.began_unix_s) ? namedClock(playback.t, record.scene) : elapsed(playback.t);
    setText(this.time, `${elapsed(playback.t)} of ${elapsed(playback.end)}`);
    setAttribute(this.time, "title", day);
    setIcon(this.play, playback.playing ? "pause" : "play");
  }

  hover(event) {
    const found = this.near(event.offsetX);
    this.marks.style.cursor = found ? "pointer" : "default";
    this.tellEvent(found);
  }

  tellEvent(found) {
    setText(this.event, found ? `${clock(found.t, this.record.scene)}  ${found.text}` : "");
  }

  place(t) {
    const { begin, end } = this.playback;
    return PAD + ((t - begin) / Math.max(1e-9, end - begin)) * (this.marks.clientWidth - 2 * PAD);
  }

  timeAt(x) {
    const { begin, end } = this.playback;
    return begin + ((x - PAD) / (this.marks.clientWidth - 2 * PAD)) * (end - begin);
  }

  near(x) {
    const close = this.record.events.filter((event) => Math.abs(this.place(event.t) - x) < REACH_PX);
    close.sort(
      (a, b) =>
        Math.abs(this.place(a.t) - x) - Math.abs(this.place(b.t) - x) || ORDER.indexOf(b.kind) - ORDER.indexOf(a.kind),
    );
    return close[0] ?? null;
  }

  draw() {
    const ratio = devicePixelRatio || 1;
    this.marks.width = this.marks.clientWidth * ratio;
    this.marks.height = (LANE + BAND) * ratio;
    const context = this.marks.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.drawStates(context);
    const events = [...this.record.events].sort((a, b) => ORDER.indexOf(a.kind) - ORDER.indexOf(b.kind));
    for (const event of events) drawMark(context, event.kind, this.place(event.t));
  }

  drawStates(context) {
    const { frames } = this.record;
    let from = 0;
    for (let i = 1; i <= frames.length; i += 1) {
      if (i < frames.length && frames[i].state === frames[from].state) continue;
      const left = this.place(frames[from].t);
      const right = this.place(frames[Math.min(i, frames.length - 1)].t);
      context.fillStyle = stateColour(frames[from].state);
      context.fillRect(left, LANE, Math.max(1, right - left), BAND);
      from = i;
    }
  }
}

// Each kind has its own form, not only its colour.
function drawMark(context, kind, x) {
  const colours = theme.colours;
  const y = 12;
  context.fillStyle = { good: colours.done, stop: colours.text, warning: colours.doubt }[kind] ?? colours.failed;
  context.strokeStyle = context.fillStyle;
  context.lineWidth = 3;
  context.beginPath();
  if (kind === "good") context.arc(x, y, 7, 0, 2 * Math.PI);
  else if (kind === "stop") context.rect(x - 5, y - 5, 10, 10);
  else if (kind === "warning")
    corners(context, [
      [x, y - 7],
      [x + 7, y + 6],
      [x - 7, y + 6],
    ]);
  else if (kind === "contact") corners(context, star(x, y));
  else
    for (const side of [-1, 1])
      corners(context, [
        [x - 6, y - 6 * side],
        [x + 6, y + 6 * side],
      ]);
  if (kind === "given-up" || kind === "error") context.stroke();
  else context.fill();
  context.fillRect(x - 0.75, y + 6, 1.5, LANE - y - 6);
  if (kind !== "good") return;
  context.strokeStyle = colours.panel;
  context.lineWidth = 2;
  context.beginPath();
  for (const [dx, dy] of [
    [-3.5, 0],
    [-1, 2.5],
    [3.5, -2.5],
  ])
    context.lineTo(x + dx, y + dy);
  context.stroke();
}

function corners(context, list) {
  list.forEach((corner, i) => (i ? context.lineTo(...corner) : context.moveTo(...corner)));
}

/** Corners of a star, the sign of a contact. */
export function star(x, y, size = 10) {
  return Array.from({ length: 16 }, (_, i) => {
    const radius = i % 2 ? size * 0.45 : size;
    return [x + radius * Math.sin((i * Math.PI) / 8), y - radius * Math.cos((i * Math.PI) / 8)];
  });
}
