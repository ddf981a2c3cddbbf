// The past track, coloured by speed.
//
// Points are grouped into batches; a batch is built into ready paths once and drawn whole, so panning costs a few calls
// and not one per point. Each batch has coarser forms for a map seen from afar. When there are too many points, every
// second one of the older half goes: the memory has a limit, and the recent track keeps its detail.

import { lastNotAbove } from "viewer/geometry.js";

const LIMIT = 20000;
const BATCH = 256;
const CLASSES = 5;
/** Points nearer than this to the one before are left out in the coarser forms. */
const SPACINGS_M = [0, 0.5, 2.5];
const SPACING_PX = 1.5;
const STEP_M = 0.05;
/** A place farther away than this, and than the rover's speed explains, is another idea of where it is. */
const JUMP_M = 5;
/** A rover that is to drive 2 m/s is a little faster at times. */
const A_LITTLE_MORE = 1.1;
const TOP_SPEEDS = [0.5, 1, 1.5, 2, 3, 4, 5, 7.5, 10, 15, 20, 30, 50, 100];

export class Track {
  constructor(limit = LIMIT) {
    this.limit = limit;
    this.clear();
  }

  clear() {
    this.times = [];
    this.points = []; // [north, east, speed, starts a new line]
    this.batches = [];
    this.heardAt = 0;
    this.fastest = 0;
    this.top = TOP_SPEEDS[1];
    this.broken = true;
    this.version = (this.version ?? 0) + 1;
  }

  /** The speed at the upper end of the colours, a round number. */
  get topSpeed() {
    return this.top;
  }

  /** The place is not known now: the line ends here. */
  interrupt() {
    this.broken = true;
  }

  /** Adds a place. Standing still adds nothing; a jump begins a new line. */
  add(t, north, east, speed) {
    const last = this.points.at(-1);
    const far = last ? Math.hypot(north - last[0], east - last[1]) : Infinity;
    const since = t - this.heardAt; // not since the last point: a rover that stood for long may jump, too
    this.heardAt = t;
    if (last && far < STEP_M) return;
    const starts = this.broken || far > Math.max(JUMP_M, (2 * Math.abs(speed ?? 0) + JUMP_M) * since);
    this.times.push(t);
    this.points.push([north, east, Math.abs(speed ?? 0), starts]);
    this.broken = false;
    this.measure(Math.abs(speed ?? 0));
    this.batches.length = Math.min(this.batches.length, Math.floor((this.points.length - 1) / BATCH));
    if (this.points.length > this.limit) this.thin();
    this.version += 1;
  }

  /** The rover will be about so fast: the colours need not change on the way. */
  expect(speed) {
    if (!(speed > 0)) return;
    this.expected = 0;
    this.measure(speed);
    this.expected = speed;
  }

  measure(speed) {
    if (speed <= this.fastest) return;
    this.fastest = speed;
    const top = TOP_SPEEDS.find((value) => value * A_LITTLE_MORE >= speed) ?? speed;
    if (this.expected && speed < 2 * this.expected && top > this.top) return; // as on ice: not worth other colours
    if (top === this.top) return;
    this.top = top;
    this.batches = []; // all colours change
  }

  thin() {
    const half = this.points.length >> 1;
    const stays = (_, i) => i > half || i % 2 === 0;
    // A line's first point that goes would join two lines.
    for (let i = 1; i < half; i += 2) if (this.points[i][3] && this.points[i + 1]) this.points[i + 1][3] = true;
    this.times = this.times.filter(stays);
    this.points = this.points.filter(stays);
    this.batches = [];
  }

  /** How many points are not later than `t`. */
  countAt(t) {
    return lastNotAbove(this.times, t) + 1;
  }

  /** Draws the track, with the context's transform set to (east, north) in metres. Points after `until` are faint. */
  draw(context, camera, colours, until = Infinity) {
    const count = Math.min(this.points.length, until);
    const level = levelFor(camera.scale);
    context.lineJoin = "round";
    context.lineCap = "round";
    this.build();
    if (count < this.points.length) {
      context.lineWidth = 2 / camera.scale;
      context.strokeStyle = colours.future;
      for (const batch of this.batches) {
        if (batch.to > count - 1 && batch.inView(camera)) context.stroke(batch.form(level).whole);
      }
    }
    const drawn = this.batches
      .filter((batch) => batch.from < count && batch.inView(camera))
      .map((batch) => (batch.to <= count ? batch : this.part(batch, count)).form(level));
    context.lineWidth = 6 / camera.scale;
    context.strokeStyle = colours.casing;
    for (const form of drawn) context.stroke(form.whole);
    context.lineWidth = 3.5 / camera.scale;
    for (let kind = 0; kind < CLASSES; kind += 1) {
      context.strokeStyle = colours.speeds[kind];
      for (const form of drawn) if (form.classes[kind]) context.stroke(form.classes[kind]);
    }
  }

  build() {
    while (this.batches.length * BATCH < this.points.length) {
      const from = this.batches.length * BATCH;
      this.batches.push(new Batch(this.points, from, Math.min(from + BATCH, this.points.length), this.top));
    }
  }

  part(batch, count) {
    return new Batch(this.points, batch.from, count, this.top);
  }

  /** The time of the point nearest to a place on the screen, or null when none is within `reach` pixels. */
  nearest(camera, x, y, reach) {
    let best = reach ** 2;
    let time = null;
    this.points.forEach(([north, east], i) => {
      const [px, py] = camera.toScreen(north, east);
      const far = (px - x) ** 2 + (py - y) ** 2;
      if (far <= best) [best, time] = [far, this.times[i]];
    });
    return time;
  }

  /** South-west and north-east corner of everything; null without points. */
  bounds() {
    this.build();
    if (this.batches.length === 0) return null;
    const boxes = this.batches.map((batch) => batch.box);
    return [
      [Math.min(...boxes.map((box) => box[0])), Math.min(...boxes.map((box) => box[1]))],
      [Math.max(...boxes.map((box) => box[2])), Math.max(...boxes.map((box) => box[3]))],
    ];
  }
}

// The coarsest form whose spacing is hardly seen.
function levelFor(scale) {
  if (scale * SPACINGS_M[2] < 1.5 * SPACING_PX) return 2;
  return scale * SPACINGS_M[1] < SPACING_PX ? 1 : 0;
}

class Batch {
  constructor(points, from, to, top) {
    Object.assign(this, { points, from, to, top, forms: [] });
    const box = [Infinity, Infinity, -Infinity, -Infinity];
    for (let i = Math.max(0, from - 1); i < to; i += 1) {
      const [north, east] = points[i];
      box[0] = Math.min(box[0], north);
      box[1] = Math.min(box[1], east);
      box[2] = Math.max(box[2], north);
      box[3] = Math.max(box[3], east);
    }
    this.box = box;
  }

  inView(camera) {
    return camera.sees(...this.box);
  }

  /** The paths of one level of detail: one of all, for the outline, and one for each class of speed. */
  form(level) {
    this.forms[level] ??= this.make(SPACINGS_M[level]);
    return this.forms[level];
  }

  make(spacing) {
    const whole = new Path2D();
    const classes = new Array(CLASSES).fill(null);
    // The line from the last batch's end belongs to this batch.
    let before = this.points[Math.max(0, this.from - 1)];
    let kindBefore = -1;
    whole.moveTo(before[1], before[0]);
    for (let i = this.from; i < this.to; i += 1) {
      const point = this.points[i];
      if (point[3]) {
        whole.moveTo(point[1], point[0]);
        [before, kindBefore] = [point, -1];
        continue;
      }
      const last = i === this.to - 1 || this.points[i + 1][3];
      if (!last && spacing > 0 && Math.hypot(point[0] - before[0], point[1] - before[1]) < spacing) continue;
      const kind = Math.min(CLASSES - 1, Math.floor((point[2] / this.top) * CLASSES));
      classes[kind] ??= new Path2D();
      if (kind !== kindBefore) classes[kind].moveTo(before[1], before[0]);
      classes[kind].lineTo(point[1], point[0]);
      whole.lineTo(point[1], point[0]);
      [before, kindBefore] = [point, kind];
    }
    return { whole, classes };
  }
}
