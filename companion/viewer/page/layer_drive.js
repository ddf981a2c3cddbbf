// The rover and what it does now: rays, rest of the path, motion, setpoint; and what moves around it.

import { pathAhead, placed } from "viewer/geometry.js";

/** The rover is never drawn smaller than this, however far away the map is seen from. */
const SMALLEST_ROVER_PX = 22;
const SMALLEST_ROVER_DISC_PX = 13;
/** A velocity is drawn as far as it leads in so long. */
const TOLD_S = 1.5;
const TOLD_STEP_S = 0.1;
const OLD_RAYS_S = 1;
/** Rays all round have no first and no last one. */
const FULL_TURN = 2 * Math.PI - 0.01;

/** Sensor rays: a faint area and a dot where something was seen. Old ones would lie. */
export function drawRays(pen, frame) {
  const { context, camera, colours } = pen;
  const { rays, pose } = frame;
  if (!rays || !pose || rays.age_s > OLD_RAYS_S) return;
  const from = camera.toScreen(pose[0], pose[1]);
  const ends = rays.m.map((range, i) =>
    range === null
      ? null
      : placed([range * Math.cos(rays.from + i * rays.step), range * Math.sin(rays.from + i * rays.step)], pose),
  );
  context.fillStyle = colours.ray;
  context.beginPath();
  if (rays.step * rays.m.length < FULL_TURN) context.moveTo(...from);
  ends.forEach((end) => context.lineTo(...(end ? camera.toScreen(...end) : from)));
  context.closePath();
  context.fill();
  context.fillStyle = colours.rayEnd;
  const seen = (i) => ends[i] && !(rays.m[i] >= rays.max_m); // a ray of full length has hit nothing
  for (let i = 0; i < ends.length; i += 1) {
    if (!seen(i)) continue;
    const end = ends[i];
    const [x, y] = camera.toScreen(...end);
    context.fillRect(x - 1, y - 1, 2, 2);
  }
}

/** What lies ahead: the path to the goal, and above it the motion that is planned in detail. */
export function drawAhead(pen, frame) {
  const { colours } = pen;
  const path = pathAhead(frame);
  const start = frame.pose && path.length ? [frame.pose.slice(0, 2)] : [];
  pen.line([...start, ...path], { colour: colours.path, width: 4, dash: [10, 5], casing: 3 });
  pen.line(frame.motion ?? [], { colour: colours.motion, width: 3.5, casing: 2 });
  drawSetpoint(pen, frame);
}

/** Where a velocity and a turn rate lead in the next seconds, if they are followed at once. */
function along([north, east, heading], { speed, turn }) {
  const places = [[north, east]];
  let [n, e, h] = [north, east, heading];
  for (let t = 0; t < TOLD_S; t += TOLD_STEP_S) {
    h += 0.5 * turn * TOLD_STEP_S;
    [n, e] = [n + speed * TOLD_STEP_S * Math.cos(h), e + speed * TOLD_STEP_S * Math.sin(h)];
    h += 0.5 * turn * TOLD_STEP_S;
    places.push([n, e]);
  }
  return places;
}

function drawSetpoint(pen, { setpoint, pose }) {
  const { context, camera, colours } = pen;
  if (!setpoint || !pose) return;
  const [x, y] = camera.toScreen(pose[0], pose[1]);
  if (setpoint.kind === "position" && setpoint.place) {
    const [px, py] = camera.toScreen(...setpoint.place);
    context.beginPath();
    context.moveTo(px, py - 8);
    context.lineTo(px + 8, py);
    context.lineTo(px, py + 8);
    context.lineTo(px - 8, py);
    context.closePath();
    pen.stroke(colours.halo, 6);
    pen.stroke(colours.setpoint, 3);
  } else if (setpoint.kind === "heading") {
    const direction = setpoint.heading - camera.up;
    context.beginPath();
    context.moveTo(x, y);
    context.lineTo(x + 46 * Math.sin(direction), y - 46 * Math.cos(direction));
    pen.stroke(colours.halo, 6);
    pen.stroke(colours.setpoint, 3, [4, 4]);
  } else if (setpoint.kind === "velocity") {
    pen.line(along(pose, setpoint), { colour: colours.setpoint, width: 3, casing: 3 });
  }
}

const moverRadius = (pen, mover) => Math.max(7, mover.radius_m * pen.camera.scale);

/** No name of a place is written where something moves. */
export function claimMovers(pen, frame) {
  for (const mover of frame.movers ?? []) {
    const [x, y] = pen.camera.toScreen(...mover.place);
    const radius = moverRadius(pen, mover) + 3;
    pen.taken.push([x - radius, y - radius, 2 * radius, 2 * radius]);
  }
}

/** Moving things: a circle, and an arrow to where they are in two seconds. */
export function drawMovers(pen, frame) {
  const { context, camera, colours } = pen;
  for (const mover of frame.movers ?? []) {
    const [x, y] = camera.toScreen(...mover.place);
    const radius = moverRadius(pen, mover);
    pen.disc(x, y, radius + 2, colours.halo);
    pen.disc(x, y, radius, null, colours.mover, 3);
    const [vn, ve] = mover.velocity ?? [0, 0];
    const end = camera.toScreen(mover.place[0] + 2 * vn, mover.place[1] + 2 * ve);
    if (Math.hypot(end[0] - x, end[1] - y) > radius) arrow(pen, [x, y], end, colours.mover);
    pen.disc(x, y, 3, colours.mover);
    if (mover.name) pen.label(mover.name, x, y, radius + 5, { colour: colours.mover });
  }
}

function arrow(pen, [x, y], [toX, toY], colour) {
  const { context } = pen;
  const angle = Math.atan2(toY - y, toX - x);
  context.beginPath();
  context.moveTo(x, y);
  context.lineTo(toX, toY);
  for (const side of [-0.5, 0.5]) {
    context.moveTo(toX, toY);
    context.lineTo(toX - 9 * Math.cos(angle + side), toY - 9 * Math.sin(angle + side));
  }
  pen.stroke(pen.colours.halo, 5);
  pen.stroke(colour, 2.5);
}

/** The rover: its outline in true size, and an arrow for its heading; the arrow alone grows when the map is far. */
export function drawRover(pen, scene, pose) {
  if (!pose) return;
  const { context, camera, colours } = pen;
  const outline = scene.rover?.outline ?? [];
  const size = 2 * Math.max(0.1, ...outline.map(([forward, right]) => Math.hypot(forward, right))) * camera.scale;
  const [x, y] = camera.toScreen(pose[0], pose[1]);
  if (size >= SMALLEST_ROVER_PX && outline.length > 2) {
    const body = outline.map((corner) => placed(corner, pose));
    pen.line(body, { colour: colours.rover, width: 2.5, casing: 4, close: true });
    context.fillStyle = colours.rover;
    context.globalAlpha = 0.35;
    context.fill();
    context.globalAlpha = 1;
  } else pen.disc(x, y, SMALLEST_ROVER_DISC_PX, colours.halo, colours.rover, 2);
  const half = Math.min(Math.max(size * 0.42, SMALLEST_ROVER_PX / 2), 60);
  context.save();
  context.translate(x, y);
  context.rotate(pose[2] - camera.up);
  context.beginPath();
  context.moveTo(0, -half * 1.2);
  context.lineTo(half * 0.6, half * 0.8);
  context.lineTo(0, half * 0.35);
  context.lineTo(-half * 0.6, half * 0.8);
  context.closePath();
  context.lineJoin = "round";
  pen.stroke(colours.roverEdge, 3);
  context.fillStyle = colours.rover;
  context.fill();
  context.restore();
}
