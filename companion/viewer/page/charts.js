// Small charts of the figures, drawn by uPlot. They are filled at most twice a second and only while they are seen.

import uPlot from "viewer/uplot.js";
import { theme } from "viewer/colours.js";
import { make, setText } from "viewer/dom.js";
import { KINDS, valueIn } from "viewer/figures.js";
import { elapsed, lasting, number, UNKNOWN } from "viewer/words.js";

const EVERY_MS = 500;
const HEIGHT = 92;
const HALF_MARK_PX = 18;
const STEPS_S = [5, 10, 30, 60, 120, 300, 600, 1800, 3600, 7200, 18000];

export class Charts {
  /** `jump(t)`, of a report, goes to a time that is clicked. */
  constructor(place, model, jump) {
    Object.assign(this, { place, model, jump, version: -1, last: 0, later: null, stale: false });
    const all = KINDS.map((kind, index) => this.part(kind, index));
    // A record is whole: what it never tells gets no chart.
    this.parts = jump ? all.filter(({ index }) => model.figures.values[index].some((value) => value !== null)) : all;
    place.append(...this.parts.map((part) => part.node));
    new ResizeObserver(() => this.resize()).observe(place);
    theme.listeners.add(() => this.parts.forEach((part) => part.plot?.redraw(false, true)));
  }

  part(kind, index) {
    const value = make("b");
    const body = make("div", { class: "chart-body" });
    const node = make("div", { class: "chart" }, make("h3", {}, kind.name, " ", value), body);
    return { kind, index, value, body, node, plot: null };
  }

  get seen() {
    return this.place.offsetWidth > 0 && this.place.offsetHeight > 0;
  }

  resize() {
    if (!this.seen) return;
    for (const part of this.parts) {
      const width = part.body.clientWidth;
      if (!part.plot && width > 0) part.plot = this.plot(part, width);
      else if (part.plot && part.plot.width !== width) part.plot.setSize({ width, height: HEIGHT });
    }
    this.fill();
  }

  plot(part, width) {
    const text = () => theme.colours.text;
    const axis = {
      stroke: text,
      grid: { stroke: () => theme.colours.grid, width: 1 },
      ticks: { show: false },
      font: "12px system-ui",
    };
    const plot = new uPlot(
      {
        width,
        height: HEIGHT,
        padding: [6, 18, 0, 0],
        legend: { show: false },
        cursor: { y: false, drag: { x: false, y: false }, points: { size: 7 } },
        scales: { x: { time: false }, y: { range: (_, __, most) => [0, Math.max(most ?? 0, 0.1) * 1.1] } },
        axes: [
          {
            ...axis,
            size: 20,
            space: 60,
            gap: 2,
            splits: (each) => this.splits(each),
            values: (each, marks) => marks.map((t) => this.mark(each, t)),
          },
          { ...axis, size: (_, texts) => widthOf(texts), space: 26, gap: 3 },
        ],
        series: [{}, { stroke: () => theme.colours.accent, width: 2, points: { show: false }, spanGaps: false }],
        hooks: { draw: [(each) => this.drawNow(each)], setCursor: [(each) => this.showValue(part, each.cursor.idx)] },
      },
      [[], []],
      part.body,
    );
    if (this.jump) plot.over.addEventListener("click", () => this.jump(plot.posToVal(plot.cursor.left, "x")));
    return plot;
  }

  // Live: how long ago. A record: the time since its beginning. None stands below the axis, where zero does.
  mark(plot, t) {
    if (plot.valToPos(t, "x") < HALF_MARK_PX) return "";
    if (this.jump) return elapsed(t + 0.001);
    const ago = Math.round((this.model.figures.times.at(-1) ?? t) - t);
    return ago < 1 ? (this.stale ? "last" : "now") : ago < 60 || ago % 60 ? `−${lasting(ago)}` : `−${ago / 60} min`;
  }

  // Marks at round times before now; in a record, after its beginning.
  splits({ scales, width }) {
    const { min, max } = scales.x;
    if (!(max > min)) return [];
    const step = STEPS_S.find((each) => (max - min) / each <= width / 80) ?? STEPS_S.at(-1);
    const first = this.jump
      ? Math.ceil(min / step) * step
      : max - Math.floor((max - min) / step) * step;
    return Array.from({ length: Math.min(20, Math.floor((max - first) / step + 1.001)) }, (_, i) => first + i * step);
  }

  drawNow(plot) {
    if (!this.jump || !Number.isFinite(this.model.frame?.t)) return;
    const x = plot.valToPos(this.model.frame.t, "x", true);
    plot.ctx.fillStyle = theme.colours.rover;
    plot.ctx.fillRect(Math.round(x) - 1, plot.bbox.top, 2 * devicePixelRatio, plot.bbox.height);
  }

  showValue(part, at) {
    const pointed = Number.isInteger(at) ? part.plot?.data[1][at] : undefined;
    setText(part.value, valueOf(part.kind, this.model.frame, pointed));
  }

  /** Shows what is new, when it is time to. */
  show(now = performance.now()) {
    if (!this.seen) return;
    for (const part of this.parts) this.showValue(part, part.plot?.cursor.idx); // the same as the large figures say
    const wait = EVERY_MS - (now - this.last);
    if (wait > 0) {
      // What was shown last must be what stays, also if nothing more comes.
      this.later ??= setTimeout(() => {
        this.later = null;
        this.show();
      }, wait);
      return;
    }
    this.last = now;
    if (this.model.figures.version === this.version) {
      for (const part of this.parts) part.plot?.redraw(false, true);
    } else this.fill();
  }

  fill() {
    this.version = this.model.figures.version;
    for (const part of this.parts) part.plot?.setData(this.model.figures.series(part.index));
  }
}

// Room for the longest mark of the axis at the left.
function widthOf(texts) {
  return Math.max(34, 10 + 7 * Math.max(0, ...(texts ?? []).map((text) => text.length)));
}

/** What stands above a chart: the value `pointed` at, else that of now. After the end there is none. */
export function valueOf(kind, frame, pointed) {
  const now = frame?.state === "ended" ? null : valueIn(frame ?? {}, kind);
  const value = pointed === undefined ? now : pointed;
  return Number.isFinite(value) ? `${number(value, kind.digits)} ${kind.unit}` : UNKNOWN;
}
