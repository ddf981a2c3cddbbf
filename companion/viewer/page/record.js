// A record: everything of a run, and how the model is set to one moment of it.
//
// Seeking back needs no pictures of the whole map: each tile keeps its own versions, ordered by time. A seek looks up
// the version of each tile and unpacks only those that differ from what is shown.

import { between, lastNotAbove } from "viewer/geometry.js";
import { split, TileMap } from "viewer/tiles.js";

const NEWS_SHOWN = 500;
const GIVEN_UP = new Set(["skipped", "unreachable", "timed out"]);

/** Reads the record from its element in the page: base64 of gzip of JSON. */
export async function readRecord(element) {
  const bytes = fromBase64(element.textContent.trim());
  const unpacked = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return JSON.parse(await new Response(unpacked).text());
}

function fromBase64(text) {
  return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
}

export class Record {
  constructor(data) {
    this.scene = data.scene;
    this.frames = filled(data.frames ?? []);
    this.times = this.frames.map((frame) => frame.t);
    this.news = this.frames.flatMap((frame) => (frame.news ?? []).map((one) => ({ ...one, t: one.t ?? frame.t })));
    this.decisions = data.decisions ?? [];
    this.decisionTimes = this.decisions.map((decision) => decision.t);
    this.contacts = data.contacts ?? [];
    this.tables = data.tables ?? [];
    this.others = data.others ?? [];
    this.events = eventsOf(this);
    this.news = [...this.news, ...this.contacts.map(told)].sort((a, b) => a.t - b.t);
    this.newsTimes = this.news.map((one) => one.t);
    this.maps = data.maps ?? [];
    this.mapTimes = this.maps.map(([t]) => t);
    this.readTiles(data.tiles ?? []);
  }

  get begin() {
    return this.times[0] ?? 0;
  }

  get end() {
    return this.times.at(-1) ?? 0;
  }

  readTiles(messages) {
    this.tiles = new Map();
    for (const [t, text] of messages) {
      for (const { column, row, bytes } of split(fromBase64(text).buffer)) {
        const map = this.mapAt(t);
        const key = `${map} ${column} ${row}`;
        if (!this.tiles.has(key)) this.tiles.set(key, { map, column, row, times: [], versions: [], shown: -1 });
        const history = this.tiles.get(key);
        history.times.push(t);
        history.versions.push(bytes);
      }
    }
  }

  // Where the map was begun anew, its tiles are those of another map.
  mapAt(t) {
    return Math.max(0, lastNotAbove(this.mapTimes, t));
  }

  /** Fills what a model keeps for a whole run. */
  fill(model) {
    model.takeScene(this.scene);
    model.figures.keptS = Infinity;
    model.track.limit = Infinity;
    for (const frame of this.frames) {
      if (frame.pose) model.track.add(frame.t, frame.pose[0], frame.pose[1], frame.speed);
      else model.track.interrupt();
      model.figures.add(frame);
    }
  }

  /** Sets the model to a time. */
  show(model, t) {
    const at = Math.max(0, lastNotAbove(this.times, t));
    model.frame = this.moment(at, t);
    model.until = model.track.countAt(t);
    const said = lastNotAbove(this.newsTimes, t) + 1;
    if (said !== model.newsCount) {
      model.news = this.news.slice(Math.max(0, said - NEWS_SHOWN), said);
      model.newsCount = said;
    }
    const map = this.mapAt(t);
    if (this.maps.length > 1 && map !== this.shownMap) {
      this.shownMap = map;
      model.takeScene({ ...this.scene, map: this.maps[map][1] });
      model.map = new TileMap(this.maps[map][1] ?? null); // another one, also where it has the same shape
      for (const history of this.tiles.values()) history.shown = -1;
    }
    for (const history of this.tiles.values()) {
      if (history.map !== map) continue;
      const version = lastNotAbove(history.times, t);
      if (version === history.shown) continue;
      history.shown = version;
      if (version < 0) model.map.forget(history.column, history.row);
      else model.map.put(history.column, history.row, history.versions[version]);
    }
    model.tell();
  }

  // Between two frames the rover is drawn where it was on the way; everything else is as the older frame says.
  moment(at, t) {
    const frame = this.frames[at];
    const next = this.frames[at + 1];
    if (!frame?.pose || !next?.pose || next.t - frame.t > 2 || t <= frame.t) return frame ?? null;
    const share = Math.min(1, (t - frame.t) / (next.t - frame.t));
    const [n, e, h] = frame.pose;
    const pose = [n + (next.pose[0] - n) * share, e + (next.pose[1] - e) * share, between(h, next.pose[2], share)];
    return { ...frame, t, pose };
  }
}

// What did not change since the frame before was left out. News are said once, so they are never taken over.
function filled(frames) {
  let before = {};
  return frames.map((frame) => {
    before = { ...before, news: [], ...frame };
    return before;
  });
}

// A contact as one of the news.
function told({ t, what }) {
  return { t, level: "error", text: `Contact: ${what}` };
}

// Whether somebody else drives the rover.
const isLed = (frame) => !["nobody", "companion"].includes(frame.drives ?? "nobody");

// Whether it stays where it has just arrived: that is told by the target's own mark.
const isAtTarget = ({ goal, statuses = [] }, { targets = [] }) =>
  targets.some(({ name }, k) => name === goal?.name && statuses[k] === "reached");

/** Marks for the timeline: [t, kind, text], ordered by time. */
function eventsOf(record) {
  const events = [];
  record.frames.forEach((frame, i) => {
    const before = record.frames[i - 1];
    if (!before) return;
    (frame.statuses ?? []).forEach((status, k) => {
      if (status === before.statuses?.[k]) return;
      const name = record.scene.targets?.[k]?.name ?? `target ${k + 1}`;
      if (status === "reached") events.push({ t: frame.t, kind: "good", text: `${name} reached` });
      else if (GIVEN_UP.has(status)) events.push({ t: frame.t, kind: "given-up", text: `${name}: ${status}` });
    });
    const stops = frame.state === "stopped" && before.state !== "stopped";
    const heldUp = Boolean(frame.held_up) && frame.held_up !== before.held_up;
    const waits =
      frame.state === "waiting" && before.state === "driving" && !frame.makes_way && !isAtTarget(frame, record.scene);
    if (stops || heldUp || waits)
      events.push({
        t: frame.t,
        kind: "stop",
        name: heldUp ? "held up" : isLed(frame) ? "taken over" : "stop",
        text: frame.line,
        place: (frame.pose ?? before.pose)?.slice(0, 2),
      });
  });
  for (const contact of record.contacts)
    events.push({ t: contact.t, kind: "contact", text: `Contact: ${contact.what}` });
  for (const one of record.news) {
    if (one.level === "warning" || one.level === "error") events.push({ t: one.t, kind: one.level, text: one.text });
  }
  return events.sort((a, b) => a.t - b.t);
}
