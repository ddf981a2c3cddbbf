// From places to pixels and back; zoom, pan, and what the view holds on to.
//
// `mode` is "fit" (everything of interest stays in view), "follow" (the rover stays in its place on the screen) or
// "free" (a person has moved the map, so nothing moves it any more).

const SMALLEST = 0.02; // pixels a metre
const LARGEST = 400;
/** In follow mode with the heading up, more of what lies ahead is shown. */
const AHEAD = 0.62;
/** What "fit" leaves free at each edge: names, scale and buttons stand there. */
const MARGINS_PX = { left: 40, right: 34, top: 44, bottom: 64 };

export class Camera {
  constructor() {
    Object.assign(this, { north: 0, east: 0, scale: 20, up: 0, width: 1, height: 1, ratio: 1 });
    this.mode = "fit";
    this.covered = 0; // pixels at the lower edge under something else
    this.coveredRight = 60; // and at the right edge, under the buttons
    this.headingUp = false;
    this.listeners = new Set();
  }

  changed() {
    for (const listener of this.listeners) listener();
  }

  get anchor() {
    if (this.mode !== "follow") return [this.width / 2, this.height / 2];
    return [this.width / 2, (this.height - this.covered) * (this.headingUp ? AHEAD : 0.5)];
  }

  resize(width, height, ratio) {
    Object.assign(this, { width, height, ratio });
  }

  toScreen(north, east) {
    const [x, y] = this.anchor;
    const n = north - this.north;
    const e = east - this.east;
    const cos = Math.cos(this.up);
    const sin = Math.sin(this.up);
    return [x + (e * cos - n * sin) * this.scale, y - (n * cos + e * sin) * this.scale];
  }

  toPlace(x, y) {
    const [left, top] = this.anchor;
    const right = (x - left) / this.scale;
    const ahead = (top - y) / this.scale;
    const cos = Math.cos(this.up);
    const sin = Math.sin(this.up);
    return [this.north + ahead * cos - right * sin, this.east + right * cos + ahead * sin];
  }

  /** Sets the context to draw in pixels of the page. */
  screen(context) {
    context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
  }

  /** Sets the context to draw in metres: x east, y north. */
  world(context) {
    const [x, y] = this.toScreen(0, 0);
    const cos = Math.cos(this.up) * this.scale * this.ratio;
    const sin = Math.sin(this.up) * this.scale * this.ratio;
    context.setTransform(cos, -sin, -sin, -cos, x * this.ratio, y * this.ratio);
  }

  /** Whether a box of places may be on the screen. With a rotated map this may say yes too often, never no. */
  sees(south, west, north, east) {
    const [x, y] = this.toScreen((south + north) / 2, (west + east) / 2);
    const reach = (Math.hypot(north - south, east - west) / 2) * this.scale + 8;
    return x > -reach && x < this.width + reach && y > -reach && y < this.height + reach;
  }

  pan(dx, dy) {
    this.free();
    [this.north, this.east] = this.toPlace(this.width / 2 - dx, this.height / 2 - dy);
    this.changed();
  }

  /** Zooms about a point of the screen: the place under it stays there. When following, it is the rover that stays. */
  zoom(factor, x = this.anchor[0], y = this.anchor[1]) {
    const held = this.toPlace(x, y);
    this.scale = Math.min(LARGEST, Math.max(SMALLEST, this.scale * factor));
    if (this.mode !== "follow") {
      this.mode = "free";
      const now = this.toPlace(x, y);
      this.north += held[0] - now[0];
      this.east += held[1] - now[1];
    }
    this.changed();
  }

  /** Shows a place in the middle. */
  centre([north, east]) {
    this.mode = "free";
    Object.assign(this, { north, east });
    this.changed();
  }

  // The middle may not lie in the middle of the screen while following; leaving that mode must not make the map jump.
  free() {
    const [north, east] = this.toPlace(this.width / 2, this.height / 2);
    this.mode = "free";
    Object.assign(this, { north, east });
  }

  setMode(mode) {
    this.mode = mode;
    if (mode === "follow" && this.scale < 8) this.scale = 24;
    this.changed();
  }

  setHeadingUp(on) {
    this.headingUp = on;
    if (!on) this.up = 0;
    this.changed();
  }

  /** Keeps what the mode promises; called before each drawing. `interest()` gives the places that "fit" shows. */
  hold(pose, interest) {
    if (this.headingUp && pose) this.up = pose[2];
    if (this.mode === "follow" && pose) [this.north, this.east] = pose;
    if (this.mode !== "fit") return;
    const places = interest();
    if (places.length) this.fit(places);
  }

  // Only moves the map when something left it or it has become far too small: a map that breathes is hard to read.
  fit(interest) {
    const across = interest.map(([n, e]) => e * Math.cos(this.up) - n * Math.sin(this.up));
    const along = interest.map(([n, e]) => n * Math.cos(this.up) + e * Math.sin(this.up));
    const box = [Math.min(...across), Math.max(...across), Math.min(...along), Math.max(...along)];
    const { left, right, top, bottom } = this.margins();
    const wide = Math.max(box[1] - box[0], 4);
    const high = Math.max(box[3] - box[2], 4);
    const ideal = Math.min((this.width - left - right) / wide, (this.height - top - bottom) / high, 80);
    const key = `${this.width} ${this.height} ${this.covered} ${this.coveredRight}`;
    const inside = interest.every(([n, e]) => {
      const [x, y] = this.toScreen(n, e);
      return x > left * 0.6 && x < this.width - right * 0.9 && y > top * 0.6 && y < this.height - bottom * 0.8;
    });
    if (inside && ideal < 1.5 * this.scale && this.fitted === key) return;
    this.fitted = key;
    this.scale = Math.min(LARGEST, Math.max(SMALLEST, ideal));
    const x = (box[0] + box[1]) / 2 + (right - left) / 2 / this.scale;
    const y = (box[2] + box[3]) / 2 - (bottom - top) / 2 / this.scale;
    this.north = y * Math.cos(this.up) - x * Math.sin(this.up);
    this.east = x * Math.cos(this.up) + y * Math.sin(this.up);
  }

  // On a small screen they shrink, or nothing would be left for the map.
  margins() {
    const small = Math.min(1, this.width / 500, this.height / 400);
    const scaled = Object.entries(MARGINS_PX).map(([edge, pixels]) => [edge, Math.max(pixels * small, 28)]);
    const margins = Object.fromEntries(scaled);
    margins.right += this.coveredRight;
    margins.bottom += this.covered;
    return margins;
  }
}
