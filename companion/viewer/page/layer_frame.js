// What belongs to the map as a picture: scale bar, north arrow, colours of speed.

import { isLost } from "viewer/freshness.js";
import { roundLength } from "viewer/layer_ground.js";
import { number } from "viewer/words.js";

const BAR_PX = 80;
const LEFT = 16;
/** Scale and colours together are about as wide as this. */
const WIDTH = 290;
/** The colours are so much higher where the buttons leave no room for both beside each other. */
const ABOVE = 38;
/** The north arrow, and what stands beside it, end here. */
const BESIDE_NORTH = 62;

/** Takes their room, so no name lies below them. */
export function claimFrame(pen) {
  const above = isNarrow(pen.camera) ? ABOVE : 0;
  const top = pen.camera.height - 42 - pen.camera.covered - above;
  pen.taken.push([8, 12, 48, 48], [LEFT - 8, top, above ? WIDTH / 2 : WIDTH, 34 + above]);
}

function isNarrow(camera) {
  return LEFT - 8 + WIDTH > camera.width - camera.coveredRight;
}

/** Draws them at the edges, above what covers the lower one. */
export function drawFrame(pen, model) {
  const bottom = pen.camera.height - 18 - pen.camera.covered;
  const right = drawScale(pen, bottom);
  drawNorth(pen);
  if (model.track.points.length < 2) return;
  if (isNarrow(pen.camera)) drawSpeeds(pen, model.track.topSpeed, LEFT, bottom - 7 - ABOVE);
  else drawSpeeds(pen, model.track.topSpeed, right + 16, bottom - 7);
}

/** Before the rover's first position there is nothing to draw: the map says so, and what is waited for. */
export function drawNothingYet(pen, { frame, map, scene }) {
  if (frame?.pose || map.shape || scene?.home) return;
  const { camera, colours } = pen;
  const free = camera.width - camera.coveredRight;
  const [x, y] = [free / 2, (camera.height - camera.covered) / 2];
  const lines = ["The rover's place is not known yet", "The map begins with it"];
  if (frame?.state === "ended") lines.splice(0, 2, "The rover's place was never known");
  const widthIn = (look) => Math.max(...lines.map((line) => pen.widthOf(line, look)));
  const usual = { size: 17, weight: 750 };
  // Beside the map's buttons a phone has little room.
  const head = { ...usual, size: usual.size * Math.min(1, Math.max(free - 48, 0) / widthIn(usual)) };
  const width = widthIn(head) + 32;
  plate(pen, x - width / 2, y - 28, width, 28 * lines.length + 6);
  lines.forEach((line, i) => {
    const look = i ? { colour: colours.soft } : head;
    pen.text(line, x, y - 10 + 26 * i, { ...look, align: "center", halo: false });
  });
}

/** That the rover is not where the map shows it, or not on it at all, stands at the map's upper edge. */
export function drawPlaceNote(pen, { frame, map, scene }) {
  const nothing = !map.shape && !scene?.home;
  if (!frame || scene?.truth || (nothing && !frame.pose)) return;
  const unknown = frame.state === "ended" ? "The rover's place was never known" : "The rover's place is not known yet";
  const note = frame.pose ? (isLost(frame) ? "Last known place: no position comes" : "") : unknown;
  if (!note) return;
  const { camera, colours } = pen;
  const room = camera.width - camera.coveredRight - BESIDE_NORTH;
  const usual = { size: 16, weight: 750 };
  const size = usual.size * Math.min(1, Math.max(room - 40, 0) / pen.widthOf(note, usual));
  const width = pen.widthOf(note, { ...usual, size }) + 24;
  const x = BESIDE_NORTH + room / 2;
  plate(pen, x - width / 2, 20, width, 32);
  pen.text(note, x, 36, { ...usual, size, colour: colours.ink, align: "center", halo: false });
}

function plate(pen, left, top, width, height) {
  const { context, colours } = pen;
  context.globalAlpha = 0.85;
  context.fillStyle = colours.panel;
  context.beginPath();
  context.roundRect(left, top, width, height, 5);
  context.fill();
  context.globalAlpha = 1;
}

function drawScale(pen, bottom) {
  const { context, camera, colours } = pen;
  const length = roundLength(camera.scale, BAR_PX);
  const width = length * camera.scale;
  const text = length >= 1000 ? `${length / 1000} km` : length >= 1 ? `${length} m` : `${number(length * 100, 0)} cm`;
  plate(pen, LEFT - 8, bottom - 24, width + 16, 34);
  context.beginPath();
  context.moveTo(LEFT, bottom - 5);
  context.lineTo(LEFT, bottom + 2);
  context.lineTo(LEFT + width, bottom + 2);
  context.lineTo(LEFT + width, bottom - 5);
  context.lineCap = "butt";
  pen.stroke(colours.ink, 2);
  pen.text(text, LEFT + width / 2, bottom - 11, { size: 13, weight: 700, align: "center", halo: false });
  return LEFT + width + 8;
}

function drawNorth(pen) {
  const { context, camera, colours } = pen;
  context.save();
  context.translate(32, 36);
  pen.disc(0, 0, 22, colours.panel, colours.line, 1);
  context.rotate(-camera.up);
  context.beginPath();
  for (const corner of [
    [0, -18],
    [7, -2],
    [-7, -2],
  ])
    context.lineTo(...corner);
  context.closePath();
  context.fillStyle = colours.ink;
  context.fill();
  context.translate(0, 8);
  context.rotate(camera.up);
  pen.text("N", 0, 1, { size: 13, weight: 800, align: "center", halo: false });
  context.restore();
}

function drawSpeeds(pen, top, left, y) {
  const { context, colours } = pen;
  const step = 15;
  const text = `${Number(top.toFixed(1))} m/s`;
  const width = 5 * step + 26 + pen.widthOf(text, { size: 12 });
  plate(pen, left - 8, y - 17, width + 12, 34);
  pen.text("0", left, y + 1, { size: 12, halo: false });
  colours.speeds.forEach((colour, i) => {
    context.fillStyle = colour;
    context.fillRect(left + 12 + i * step, y - 4, step, 9);
  });
  pen.text(text, left + 18 + 5 * step, y + 1, { size: 12, halo: false });
}
