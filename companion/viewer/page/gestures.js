// Mouse, wheel, touch and keys for the map. They only move the camera; a short press without movement is a tap.

import { typesInto } from "viewer/dom.js";

const TAP_PX = 8;
const WHEEL = 0.0015;
const PINCH_WHEEL = 0.01; // a trackpad's pinch arrives as a wheel with ctrl, in small steps
const KEY_PAN_PX = 80;
const KEY_ZOOM = 1.4;

/** Moves the camera by what happens on the canvas; `tap(x, y)` hears of taps. */
export function listen(canvas, camera, tap) {
  const fingers = new Map();
  let travelled = 0;
  const spot = (event) => {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  canvas.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    canvas.setPointerCapture(event.pointerId);
    if (fingers.size === 0) travelled = 0;
    fingers.set(event.pointerId, spot(event));
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!fingers.has(event.pointerId)) return;
    const before = [...fingers.values()];
    fingers.set(event.pointerId, spot(event));
    const after = [...fingers.values()];
    travelled += Math.hypot(middle(after)[0] - middle(before)[0], middle(after)[1] - middle(before)[1]);
    if (fingers.size > 1) travelled = Infinity;
    if (travelled > TAP_PX) move(camera, before, after);
  });
  const release = (event) => {
    const was = fingers.delete(event.pointerId);
    if (was && fingers.size === 0 && event.type === "pointerup" && travelled <= TAP_PX) tap(...spot(event));
  };
  canvas.addEventListener("pointerup", release);
  canvas.addEventListener("pointercancel", release);
  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      const lines = event.deltaMode === 1 ? 16 : 1;
      camera.zoom(Math.exp(-event.deltaY * lines * (event.ctrlKey ? PINCH_WHEEL : WHEEL)), ...spot(event));
    },
    { passive: false },
  );
  canvas.addEventListener("dblclick", (event) => camera.zoom(2, ...spot(event)));
}

function move(camera, before, after) {
  const [x, y] = middle(after);
  const [fromX, fromY] = middle(before);
  if (before.length > 1) {
    const spread = apart(after) / Math.max(1, apart(before));
    camera.zoom(spread, x, y);
    if (camera.mode === "follow") return;
  }
  camera.pan(x - fromX, y - fromY);
}

function middle(spots) {
  return [0, 1].map((axis) => spots.reduce((sum, spot) => sum + spot[axis], 0) / spots.length);
}

function apart(spots) {
  return Math.hypot(spots[0][0] - spots[1][0], spots[0][1] - spots[1][1]);
}

/** Keys of the whole page: `actions` maps a key to a function. Arrows move the map while it has the focus. */
export function listenKeys(canvas, camera, actions) {
  const pans = {
    ArrowLeft: [KEY_PAN_PX, 0],
    ArrowRight: [-KEY_PAN_PX, 0],
    ArrowUp: [0, KEY_PAN_PX],
    ArrowDown: [0, -KEY_PAN_PX],
  };
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || typesInto(event.target)) return;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (pans[key] && document.activeElement === canvas) camera.pan(...pans[key]);
    else if (key === "+" || key === "=") camera.zoom(KEY_ZOOM);
    else if (key === "-") camera.zoom(1 / KEY_ZOOM);
    // A space or Enter on a button presses that button.
    else if (actions[key] && !(key === " " && event.target.closest?.("button, a, summary"))) actions[key]();
    else return;
    event.preventDefault();
  });
}
