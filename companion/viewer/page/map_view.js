// The map on a canvas. It draws in the browser's next picture, and only when somebody said that something has changed.

import { theme } from "viewer/colours.js";
import { outermost } from "viewer/geometry.js";
import { claimMovers, drawAhead, drawMovers, drawRays, drawRover } from "viewer/layer_drive.js";
import { claimFrame, drawFrame, drawNothingYet, drawPlaceNote } from "viewer/layer_frame.js";
import { drawBorders, drawGround } from "viewer/layer_ground.js";
import { drawMarks, drawPointers } from "viewer/layer_marks.js";
import { Pen } from "viewer/pen.js";

const SHARPEST = 2; // more canvas pixels than this for one of the page cost time and show nothing
const USUAL_SIGHT_M = 8;

export class MapView {
  constructor(canvas, model, camera) {
    Object.assign(this, { canvas, model, camera, waiting: false });
    this.context = canvas.getContext("2d", { alpha: false });
    /** Functions (pen) of other modules, drawn below the track, below the marks and their names, or above. */
    this.below = [];
    this.between = [];
    this.above = [];
    /** Functions of other modules that give more places which "fit" keeps in view. */
    this.besides = [];
    /** Boxes of the screen that are covered: no name stands there. */
    this.taken = [];
    this.drawn = 0;
    camera.listeners.add(() => this.invalidate());
    model.listeners.add(() => this.invalidate());
    theme.listeners.add(() => {
      model.map.repaint();
      this.invalidate();
    });
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
  }

  resize() {
    const ratio = Math.min(SHARPEST, devicePixelRatio || 1);
    const { clientWidth: width, clientHeight: height } = this.canvas;
    this.canvas.width = Math.max(1, Math.round(width * ratio));
    this.canvas.height = Math.max(1, Math.round(height * ratio));
    this.camera.resize(Math.max(1, width), Math.max(1, height), ratio);
    this.draw(); // at once: a canvas is empty after a change of its size
  }

  invalidate() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.draw();
    });
  }

  draw() {
    const { model, camera, context } = this;
    this.drawn += 1;
    camera.hold(model.frame?.pose, () => this.interest());
    camera.screen(context);
    const pen = new Pen(context, camera, theme.colours);
    drawGround(pen, model);
    if (!model.scene) return;
    drawBorders(pen, model.scene);
    const frame = model.frame;
    // These take their room first, so no name covers them.
    claimFrame(pen);
    pen.taken.push(...this.taken);
    if (frame?.pose) pen.taken.push([...camera.toScreen(frame.pose[0], frame.pose[1]).map((at) => at - 14), 28, 28]);
    if (frame) claimMovers(pen, frame);
    for (const layer of this.below) layer(pen);
    camera.world(context);
    model.track.draw(context, camera, theme.colours, model.until);
    camera.screen(context);
    if (frame) drawRays(pen, frame);
    if (frame) drawAhead(pen, frame);
    for (const layer of this.between) layer(pen);
    drawMarks(pen, model.scene, frame);
    if (frame) drawMovers(pen, frame);
    for (const layer of this.above) layer(pen);
    drawRover(pen, model.scene, frame?.pose);
    drawPointers(pen, frame);
    drawFrame(pen, model);
    drawNothingYet(pen, model);
    drawPlaceNote(pen, model);
  }

  /** As far as the sensor sees; without it the rover alone would fill the map. */
  sight() {
    const { pose, rays } = this.model.frame ?? {};
    if (!pose) return [];
    const far = rays?.max_m ?? USUAL_SIGHT_M;
    return [-far, far].map((off) => [pose[0] + off, pose[1] + off]);
  }

  /** The places that "fit" keeps in view. */
  interest() {
    const { scene, frame, track, map } = this.model;
    const places = [];
    if (frame?.pose) places.push(frame.pose.slice(0, 2));
    if (frame?.goal) places.push(frame.goal.place);
    if (frame?.path) places.push(...outermost(frame.path));
    if (scene?.home) places.push(scene.home);
    places.push(...outermost((scene?.targets ?? []).map((target) => target.place)));
    for (const border of scene?.borders ?? []) places.push(...outermost(border.corners));
    places.push(...(track.bounds() ?? []), ...map.bounds());
    for (const more of this.besides) places.push(...more());
    if (map.shape && (scene?.truth || places.length < 2)) {
      const { south_m: south, west_m: west, cell_m: cell, rows, columns } = map.shape;
      places.push([south, west], [south + rows * cell, west + columns * cell]);
    }
    if (scene?.truth || (!scene?.home && !map.shape)) places.push(...this.sight());
    return places;
  }
}
