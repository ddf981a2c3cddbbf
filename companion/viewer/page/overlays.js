// What is drawn on the map beside the run itself: contacts, and in a report stops and the tracks of other records.

import { make } from "viewer/dom.js";
import { lastNotAbove, outermost } from "viewer/geometry.js";
import { star } from "viewer/timeline.js";

const DASHES = [
  [9, 5],
  [3, 4],
  [14, 4, 3, 4],
  [6, 6],
  [2, 6],
];

/** A place farther from the last one than this, and than any rover drives meanwhile, is another idea of where it is. */
const JUMP_M = 5;
const FASTEST_M_S = 5;

/** Where the rover touched something, as stars. */
export function drawContacts(pen, places) {
  const spots = places.map((place) => pen.camera.toScreen(...place));
  drawStars(pen, spots);
  nameContacts(pen, spots);
}

/** The rover where the map is far away: its disc covers so much of the screen round its place. */
const COVERED_PX = 24;
/** A mark that it would cover stands so far below it. */
const AWAY_PX = 34;

/** Where the rover stopped, or was held up on its way, as the squares of the timeline; and contacts, over them. */
export function drawHappenings(pen, events, contacts, pose) {
  const [stops, stars] = spotsOf(pen, events, contacts, pose);
  drawLeaders(pen, [...stops, ...stars]);
  drawSquares(pen, stops);
  drawStars(pen, stars);
  nameContacts(pen, stars);
  events.forEach(({ name }, i) => pen.label(name, ...stops[i], 12, { size: 12, colour: pen.colours.ink }));
}

/** Takes the room of these marks, so that no name lies under or over them. */
export function claimHappenings(pen, events, contacts, pose) {
  for (const [x, y] of spotsOf(pen, events, contacts, pose).flat()) pen.taken.push([x - 9, y - 9, 18, 18]);
}

// Where marks of stops and of contacts stand on the screen: [x, y], and where each happened if that is elsewhere.
function spotsOf(pen, events, contacts, pose) {
  const rover = pose && pen.camera.toScreen(pose[0], pose[1]);
  return [events.map((one) => one.place), contacts].map((places) =>
    places.map((place) => besideRover(pen.camera.toScreen(...place), rover)),
  );
}

// The rover lies over all marks: one that it would cover stands below it.
function besideRover([x, y], rover) {
  if (!rover || Math.hypot(x - rover[0], y - rover[1]) > COVERED_PX) return [x, y];
  return [rover[0], rover[1] + AWAY_PX, [x, y]];
}

// From a mark that stands below the rover to the place that it is about.
function drawLeaders(pen, spots) {
  for (const [x, y, place] of spots) {
    if (!place) continue;
    for (const [colour, width] of [
      [pen.colours.halo, 6],
      [pen.colours.ink, 2],
    ]) {
      pen.context.beginPath();
      pen.context.moveTo(x, y);
      pen.context.lineTo(...place);
      pen.stroke(colour, width);
    }
  }
}

function drawStars(pen, spots) {
  const { context, colours } = pen;
  for (const [x, y] of spots) {
    context.beginPath();
    star(x, y, 12).forEach(([px, py]) => context.lineTo(px, py));
    context.closePath();
    context.lineJoin = "round";
    pen.stroke(colours.halo, 4);
    context.fillStyle = colours.failed;
    context.fill();
  }
}

function nameContacts(pen, spots) {
  for (const [x, y] of spots) pen.label("contact", x, y, 14, { size: 12, colour: pen.colours.failed });
}

function drawSquares(pen, spots) {
  const { context, colours } = pen;
  for (const [x, y] of spots) {
    context.beginPath();
    context.rect(x - 6, y - 6, 12, 12);
    pen.stroke(colours.halo, 4);
    context.fillStyle = colours.ink;
    context.fill();
  }
}

/** The places of a track [t, north, east] as lines: where the position jumps, another one begins. */
export function unbroken(track) {
  const lines = [];
  track.forEach(([t, north, east], i) => {
    const [before, n, e] = track[i - 1] ?? [t, NaN, NaN];
    if (!(Math.hypot(north - n, east - e) <= JUMP_M + FASTEST_M_S * (t - before))) lines.push([]);
    lines.at(-1).push([north, east]);
  });
  return lines;
}

/** Other records: dashed lines, each with its colour and its dashes, and a ring where that rover was at this time. */
export class Others {
  constructor(others, begin, changed) {
    // Clocks differ between runs: each is counted from its own beginning.
    this.others = others.map((other) => ({
      ...other,
      shown: !other.elsewhere, // another mission has its own zero: its track says nothing on this map
      times: other.track.map(([t]) => t - other.track[0][0]),
      line: other.track.map((p) => p.slice(1)),
      lines: unbroken(other.track),
    }));
    this.begin = begin;
    const row = (other, i) => {
      const box = make("input", {
        type: "checkbox",
        checked: other.shown,
        onchange: () => {
          other.shown = box.checked;
          changed();
        },
      });
      const swatch = make("span", { class: `other other-${i % DASHES.length}` });
      return make("label", {}, box, swatch, other.elsewhere ? `${other.name} (another mission)` : other.name);
    };
    this.node = make(
      "div",
      { class: "others", hidden: others.length === 0 },
      make("h2", {}, "Other records"),
      ...this.others.map(row),
    );
  }

  /** Where the tracks that are shown lead. */
  places() {
    return this.others.filter((other) => other.shown).flatMap((other) => outermost(other.line));
  }

  drawTracks(pen) {
    this.others.forEach((other, i) => {
      const colour = pen.colours.others[i % pen.colours.others.length];
      if (!other.shown) return;
      const look = { colour, width: 2.5, dash: DASHES[i % DASHES.length], casing: 2 };
      for (const line of other.lines) pen.line(line, look);
    });
  }

  drawPlaces(pen, t) {
    this.others.forEach((other, i) => {
      if (!other.shown) return;
      const colour = pen.colours.others[i % pen.colours.others.length];
      const at = lastNotAbove(other.times, t - this.begin);
      if (at < 0) return;
      const [x, y] = pen.camera.toScreen(...other.line[at]);
      pen.disc(x, y, 8, pen.colours.halo, colour, 4);
      pen.label(other.name, x, y, 12, { size: 12, colour });
    });
  }
}
