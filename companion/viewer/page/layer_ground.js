// What the rover drives on: cells, a grid of metres, fences.

const GRID_PX = 90;

/** Cells, and above them a faint grid: on unknown ground it is all that shows that the map moves. */
export function drawGround(pen, model) {
  const { context, camera, colours } = pen;
  // A simulator knows its whole world: what lies outside is open ground.
  context.fillStyle = model.scene?.truth ? colours.free : colours.unknown;
  context.fillRect(0, 0, camera.width, camera.height);
  camera.world(context);
  model.map.draw(context, camera, colours);
  camera.screen(context);
  drawGrid(pen);
}

/** A round length of one, two or five metres times a power of ten, at least `pixels` long on the screen. */
export function roundLength(scale, pixels) {
  const least = pixels / scale;
  const power = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map((step) => step * power).find((length) => length >= least * 0.999);
}

function drawGrid(pen) {
  const { context, camera, colours } = pen;
  const step = roundLength(camera.scale, GRID_PX);
  const corners = [
    [0, 0],
    [camera.width, 0],
    [0, camera.height],
    [camera.width, camera.height],
  ].map((c) => camera.toPlace(...c));
  const [south, north] = [Math.min(...corners.map((c) => c[0])), Math.max(...corners.map((c) => c[0]))];
  const [west, east] = [Math.min(...corners.map((c) => c[1])), Math.max(...corners.map((c) => c[1]))];
  context.beginPath();
  const line = (from, to) => {
    context.moveTo(...camera.toScreen(...from).map(sharp));
    context.lineTo(...camera.toScreen(...to).map(sharp));
  };
  const sharp = camera.up === 0 ? (value) => Math.round(value) + 0.5 : (value) => value;
  for (let n = Math.ceil(south / step) * step; n <= north; n += step) line([n, west], [n, east]);
  for (let e = Math.ceil(west / step) * step; e <= east; e += step) line([south, e], [north, e]);
  pen.stroke(colours.grid, 1);
}

/** Fences. Short strokes stand on the side that is closed, so a line says which side to stay on without its colour. */
export function drawBorders(pen, scene) {
  for (const border of scene.borders ?? []) {
    if (border.corners.length < 3) continue;
    pen.line(border.corners, { colour: pen.colours.fence, width: 2.5, casing: 2, close: true });
    drawHatch(pen, border);
  }
}

function drawHatch(pen, border) {
  const { context, camera } = pen;
  const spots = border.corners.map(([n, e]) => camera.toScreen(n, e));
  const area = spots.reduce((sum, [x, y], i) => {
    const [nextX, nextY] = spots[(i + 1) % spots.length];
    return sum + x * nextY - nextX * y;
  }, 0);
  const side = (area > 0 ? 1 : -1) * (border.keeps_in ? -1 : 1) * 6;
  context.beginPath();
  spots.forEach(([x, y], i) => {
    const [nextX, nextY] = spots[(i + 1) % spots.length];
    const long = Math.hypot(nextX - x, nextY - y);
    const count = Math.min(400, Math.floor(long / 14));
    for (let k = 1; k <= count; k += 1) {
      const at = [x + ((nextX - x) * (k - 0.5)) / count, y + ((nextY - y) * (k - 0.5)) / count];
      context.moveTo(...at);
      context.lineTo(at[0] - ((nextY - y) / long) * side, at[1] + ((nextX - x) / long) * side);
    }
  });
  pen.stroke(pen.colours.fence, 1.5);
}
