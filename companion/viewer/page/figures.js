// The few numbers over time that are drawn as charts. Live they reach back ten minutes; a record keeps all of them.

import { isLost, silence } from "viewer/freshness.js";

const KEPT_S = 600;
const MOST = 6000;
const DRAWN = 2000;

/** What is drawn: name, unit, and where it is in a frame. */
export const KINDS = [
  { name: "Speed", unit: "m/s", digits: 1, of: speedOf },
  { name: "Clearance", unit: "m", digits: 2, of: (frame) => frame.figures?.clearance_m },
  { name: "Planning", unit: "ms", digits: 1, of: (frame) => frame.figures?.planning_ms },
  { name: "Latency", unit: "ms", digits: 0, of: (frame) => frame.figures?.latency_ms },
];

// Forwards or backwards; a millimetre of rolling back is no negative zero.
function speedOf({ speed }) {
  return Number.isFinite(speed) ? Math.abs(speed) : null;
}

/** One of them now; null where it is not known, or goes by what is old. */
export function valueIn(frame, kind) {
  return silence(frame) || isLost(frame) ? null : (kind.of(frame) ?? null);
}

export class Figures {
  constructor(keptS = KEPT_S) {
    this.keptS = keptS;
    this.clear();
  }

  clear() {
    this.times = [];
    this.values = KINDS.map(() => []);
    this.version = (this.version ?? 0) + 1;
  }

  add(frame) {
    if (!Number.isFinite(frame.t)) return;
    this.times.push(frame.t);
    KINDS.forEach((kind, i) => this.values[i].push(valueIn(frame, kind)));
    this.version += 1;
    // Cut now and then, not each time: moving the whole list is what costs.
    if (this.keptS < Infinity && this.times.length % 100 === 0) this.cut();
  }

  cut() {
    const oldest = this.times.at(-1) - this.keptS;
    const gone = Math.max(
      this.times.findIndex((t) => t >= oldest),
      this.times.length - MOST,
    );
    this.times.splice(0, gone);
    for (const values of this.values) values.splice(0, gone);
  }

  /** Times and values of one figure, not more than a chart can show. The highest of each group stays. */
  series(index) {
    const group = Math.ceil(this.times.length / DRAWN);
    if (group <= 1) return [this.times, this.values[index]];
    const times = [];
    const values = [];
    for (let i = 0; i < this.times.length; i += group) {
      const known = this.values[index].slice(i, i + group).filter((value) => value !== null);
      times.push(this.times[i]);
      values.push(known.length ? Math.max(...known) : null);
    }
    return [times, values];
  }
}
