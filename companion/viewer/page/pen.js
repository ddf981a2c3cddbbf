// Drawing helpers that all layers share: lines through places, texts with a halo, labels that do not overlap.

const FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif";
/** Between two names side by side there is twice as much: else they read as one. */
const GAP_PX = 2;

/** What a layer draws with. It always works in pixels of the page; places are turned into pixels one by one. */
export class Pen {
  constructor(context, camera, colours) {
    Object.assign(this, { context, camera, colours, taken: [] });
  }

  /** A line through places, with a casing below it that keeps it visible on any ground. */
  line(places, { colour, width, dash = [], casing = 0, close = false }) {
    if (places.length < 2) return;
    const { context } = this;
    context.beginPath();
    places.forEach(([north, east], i) => {
      const [x, y] = this.camera.toScreen(north, east);
      if (i === 0) context.moveTo(x, y);
      else context.lineTo(x, y);
    });
    if (close) context.closePath();
    context.lineJoin = "round";
    context.lineCap = dash.length ? "butt" : "round";
    if (casing) this.stroke(this.colours.casing, width + casing, []);
    this.stroke(colour, width, dash);
  }

  stroke(colour, width, dash = []) {
    this.context.setLineDash(dash);
    this.context.strokeStyle = colour;
    this.context.lineWidth = width;
    this.context.stroke();
    this.context.setLineDash([]);
  }

  disc(x, y, radius, fill, edge, width = 2) {
    const { context } = this;
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    context.fillStyle = fill;
    if (fill) context.fill();
    if (edge) this.stroke(edge, width);
  }

  text(text, x, y, { size = 13, weight = 600, colour = this.colours.ink, align = "left", halo = true } = {}) {
    const { context } = this;
    context.font = `${weight} ${size}px ${FONT}`;
    context.textAlign = align;
    context.textBaseline = "middle";
    if (halo) {
      context.lineJoin = "round";
      context.lineWidth = 4;
      context.strokeStyle = this.colours.halo;
      context.strokeText(text, x, y);
    }
    context.fillStyle = colour;
    context.fillText(text, x, y);
  }

  widthOf(text, { size = 13, weight = 600 } = {}) {
    this.context.font = `${weight} ${size}px ${FONT}`;
    return this.context.measureText(text).width;
  }

  /** Takes a rectangle of the screen for itself, unless another has it already. */
  claim(left, top, width, height) {
    const free = this.taken.every(
      (box) => left > box[0] + box[2] || left + width < box[0] || top > box[1] + box[3] || top + height < box[1],
    );
    if (free) this.taken.push([left, top, width, height]);
    return free;
  }

  /** A name beside a mark: right of it, or where else there is room. It is left out when there is none. */
  label(text, x, y, away, options = {}) {
    const width = this.widthOf(text, options);
    const high = (options.size ?? 13) + 4;
    const spots = [
      [x + away, y - high / 2],
      [x - away - width, y - high / 2],
      [x - width / 2, y - away - high],
      [x - width / 2, y + away],
      // Near an edge the middle of a long name cannot stand above or below the mark, but its end can.
      ...[x - width + away, x - away].flatMap((left) => [
        [left, y + away],
        [left, y - away - high],
      ]),
    ];
    const inside = ([left, top]) =>
      left > 4 &&
      left + width < this.camera.width - this.camera.coveredRight &&
      top > 4 &&
      top + high < this.camera.height - this.camera.covered - 4;
    const spot = spots.find(
      (each) => inside(each) && this.claim(each[0] - GAP_PX, each[1], width + 2 * GAP_PX, high),
    );
    if (spot) this.text(text, spot[0], spot[1] + high / 2, options);
    return Boolean(spot);
  }
}
