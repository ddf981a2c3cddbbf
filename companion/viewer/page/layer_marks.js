// Marks with names: home, targets with their state, the goal; and pointers at the edge to what is out of view.

import { distance } from "viewer/geometry.js";
import { metres, short } from "viewer/words.js";

const RADIUS = 12;
/** Marks that would cover each other are smaller, down to this. */
const SMALLEST = 6;
const FAILED = new Set(["unreachable", "timed out", "failed", "given up"]);
const EDGE_PX = 34;

/** What kind of sign a target's status has. */
export function kindOf(status) {
  if (status === "reached") return "good";
  if (FAILED.has(status)) return "error";
  return status === "skipped" ? "skipped" : "pending";
}

/** The radius of the mark at each place of the screen: half the way to the nearest other one, within bounds. */
export function radii(spots) {
  const order = spots.map((_, i) => i).sort((a, b) => spots[a][0] - spots[b][0]);
  const found = spots.map(() => RADIUS);
  order.forEach((a, at) => {
    for (let next = at + 1; next < order.length; next += 1) {
      const b = order[next];
      if (spots[b][0] - spots[a][0] >= 2 * RADIUS) break;
      const half = Math.max(SMALLEST, Math.hypot(spots[b][0] - spots[a][0], spots[b][1] - spots[a][1]) / 2 - 1);
      found[a] = Math.min(found[a], half);
      found[b] = Math.min(found[b], half);
    }
  });
  return found;
}

/** Home and all targets. The goal's name comes first, so it has room, and its mark last, so nothing covers it. */
export function drawMarks(pen, scene, frame) {
  const goal = frame?.goal;
  const targets = scene.targets ?? [];
  const current = goal
    ? targets.findIndex((target) => target.name === goal.name && distance(target.place, goal.place) < 0.5)
    : -1;
  const radius = radii(targets.map((target) => pen.camera.toScreen(...target.place)));
  targets.forEach((target, i) => takeRoom(pen, target, radius[i]));
  const goalRadius = radius[current] ?? RADIUS;
  if (goal) nameGoal(pen, goal, goalRadius);
  if (scene.home) drawHome(pen, scene.home);
  targets.forEach((target, i) => {
    if (i !== current) drawTarget(pen, target, i, frame?.statuses?.[i] ?? "pending", radius[i]);
  });
  if (goal) drawGoal(pen, goal, current >= 0 ? String(current + 1) : "", goalRadius);
}

// No name lies over a target's mark.
function takeRoom(pen, target, radius) {
  const [x, y] = pen.camera.toScreen(...target.place);
  const half = radius + 2;
  pen.taken.push([x - half, y - half, 2 * half, 2 * half]);
}

function nameGoal(pen, goal, radius) {
  const [x, y] = pen.camera.toScreen(...goal.place);
  const half = radius + 8;
  pen.taken.push([x - half, y - half, 2 * half, 2 * half]);
  pen.label(short(goal.name), x, y, radius + 14, { size: 16, weight: 750 });
}

function drawGoal(pen, goal, sign, radius) {
  const { camera, colours } = pen;
  const [x, y] = camera.toScreen(...goal.place);
  const share = radius / RADIUS;
  pen.disc(x, y, radius + 8 * share, null, colours.halo, 7 * share);
  pen.disc(x, y, radius + 8 * share, null, colours.goal, 3.5 * share);
  pen.disc(x, y, radius + 1, colours.goal, colours.halo, 2);
  const size = radius + 2;
  pen.text(sign, x, y + 1, { size, weight: 800, colour: colours.goalText, align: "center", halo: false });
}

function drawHome(pen, home) {
  const { context, camera, colours } = pen;
  const [x, y] = camera.toScreen(...home);
  context.beginPath();
  for (const [dx, dy] of [
    [-10, 0],
    [0, -10],
    [10, 0],
    [7, 0],
    [7, 9],
    [-7, 9],
    [-7, 0],
  ])
    context.lineTo(x + dx, y + dy);
  context.closePath();
  pen.stroke(colours.halo, 6);
  context.fillStyle = colours.halo;
  context.fill();
  pen.stroke(colours.home, 2.2);
  pen.label("home", x, y, 15, { size: 12 });
}

function drawTarget(pen, target, index, status, radius) {
  const { camera, colours } = pen;
  const [x, y] = camera.toScreen(...target.place);
  if (x < -40 || y < -40 || x > camera.width + 40 || y > camera.height + 40) return;
  const kind = kindOf(status);
  const fill = { good: colours.done, error: colours.failed }[kind] ?? colours.pending;
  const edge = kind === "skipped" ? colours.soft : fill === colours.pending ? colours.ink : fill;
  pen.disc(x, y, radius + 2, colours.halo);
  pen.disc(x, y, radius, fill, edge, 2);
  drawSign(pen, kind, index, x, y, radius / RADIUS);
  const name = kind === "pending" ? short(target.name) : `${short(target.name)} · ${status}`;
  pen.label(name, x, y, radius + 5);
}

function drawSign(pen, kind, index, x, y, share) {
  const { context, colours } = pen;
  if (kind === "pending") {
    pen.text(String(index + 1), x, y + 1, { size: 13 * share, weight: 750, align: "center", halo: false });
    return;
  }
  const strokes = {
    good: [
      [
        [-5, 0],
        [-1.5, 4],
        [5, -4],
      ],
    ],
    error: [
      [
        [-4, -4],
        [4, 4],
      ],
      [
        [4, -4],
        [-4, 4],
      ],
    ],
    skipped: [
      [
        [-5, 0],
        [5, 0],
      ],
    ],
  }[kind];
  context.beginPath();
  for (const stroke of strokes)
    stroke.forEach(([dx, dy], i) =>
      (i ? context.lineTo(x + share * dx, y + share * dy) : context.moveTo(x + share * dx, y + share * dy)),
    );
  context.lineCap = "round";
  pen.stroke(kind === "skipped" ? colours.ink : colours.panel, 2.6 * share);
}

/** Arrows at the edge of the map to the rover and the goal while they are out of view. */
export function drawPointers(pen, frame) {
  if (!frame?.pose) return;
  const rover = frame.pose.slice(0, 2);
  drawPointer(pen, rover, "rover");
  if (frame.goal)
    drawPointer(pen, frame.goal.place, `${short(frame.goal.name)}, ${metres(distance(rover, frame.goal.place))}`);
}

function drawPointer(pen, spot, text) {
  const { context, camera, colours } = pen;
  const [x, y] = camera.toScreen(...spot);
  if (x > 0 && y > 0 && x < camera.width && y < camera.height - camera.covered) return;
  // They stand clear of buttons at the right and of the scale below.
  const [halfX, halfY] = [(camera.width - camera.coveredRight) / 2, (camera.height - camera.covered - EDGE_PX) / 2];
  const [dx, dy] = [x - halfX, y - halfY];
  const share = Math.min((halfX - EDGE_PX) / Math.abs(dx || 1), (halfY - EDGE_PX) / Math.abs(dy || 1));
  const [atX, atY] = [halfX + dx * share, halfY + dy * share];
  context.save();
  context.translate(atX, atY);
  context.rotate(Math.atan2(dy, dx));
  context.beginPath();
  for (const corner of [
    [16, 0],
    [-8, -11],
    [-3, 0],
    [-8, 11],
  ])
    context.lineTo(...corner);
  context.closePath();
  pen.stroke(colours.halo, 5);
  context.fillStyle = colours.goal;
  context.fill();
  context.restore();
  pen.label(text, atX, atY, 20, { size: 14, weight: 700 });
}
