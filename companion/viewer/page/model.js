// What the page knows: scene, newest frame, map, track, news, figures. The live page feeds it with messages; the report
// sets it to a moment of a record. Views read it and never change it.

import { Figures } from "viewer/figures.js";
import { split, TileMap } from "viewer/tiles.js";
import { Track } from "viewer/track.js";

const NEWS_KEPT = 500;
/** Where one of these differs in a scene, it is another run, or another map. */
const RUN_KEYS = ["run", "map_epoch", "began_unix_s"];
/** A clock that goes back by more than this is another run's. */
const BACK_S = 1;
/** After a gap as long as this, what lay between is not known: the track must not cross it as a straight line. */
const GAP_S = 5;

export class Model {
  constructor() {
    this.listeners = new Set();
    this.scene = null;
    this.map = new TileMap(null);
    this.track = new Track();
    this.until = Infinity; // how many points of the track are past; only a report has later ones
    this.figures = new Figures();
    this.forget();
  }

  /** Forgets everything that a run has left behind, except the scene. */
  forget() {
    this.frame = null;
    this.news = [];
    this.newsCount = 0; // grows with every news, also when old ones are dropped
    this.lastT = -Infinity;
    this.track.clear();
    this.track.expect(this.scene?.rover?.cruise_m_s);
    this.figures.clear();
  }

  tell() {
    for (const listener of this.listeners) listener();
  }

  /** A new connection: its first scene begins the map anew, because all tiles are sent again. */
  connected() {
    this.mapIsOld = true;
  }

  /** Takes a message of the source; unknown kinds are left alone, so an older page works with a newer source. */
  take(message) {
    if (message.kind === "scene") this.takeScene(message);
    else if (message.kind === "past") this.takePast(message);
    else if (message.kind === "frame") this.takeFrame(message);
    else return;
    this.tell();
  }

  takeTiles(buffer) {
    for (const { column, row, bytes } of split(buffer)) this.map.put(column, row, bytes);
    this.tell();
  }

  takeScene(scene) {
    const before = this.scene;
    const another = before && RUN_KEYS.some((key) => before[key] !== scene[key]);
    const shapeChanged = JSON.stringify(before?.map ?? null) !== JSON.stringify(scene.map ?? null);
    if (another) this.forget();
    if (another || shapeChanged || this.mapIsOld) this.map = new TileMap(scene.map ?? null);
    this.mapIsOld = false;
    this.scene = scene;
    this.track.expect(scene.rover?.cruise_m_s);
  }

  // After a lost connection the past overlaps with what is known; the rest of it fills the gap.
  takePast({ frames = [], track = [], news = [] }) {
    const last = frames.at(-1);
    if (last && last.t < this.lastT - BACK_S) this.forget();
    // Of what was before these frames only the track is told, as fewer places.
    for (const [t, north, east, speed, starts] of track) {
      if (!(t > this.lastT)) continue;
      if (starts) this.track.interrupt();
      this.track.add(t, north, east, speed);
      this.lastT = t;
    }
    for (const frame of frames) this.follow(frame);
    this.addNews(news.filter((one) => !this.knows(one)));
  }

  knows({ t, text }) {
    return this.news.some((one) => one.t === t && one.text === text);
  }

  takeFrame(frame) {
    if (frame.t < this.lastT - BACK_S) this.forget();
    this.follow(frame);
    this.addNews(frame.news ?? []);
    this.frame = frame;
  }

  follow(frame) {
    if (!(frame.t > this.lastT)) return;
    if (!frame.pose || frame.t - this.lastT > GAP_S) this.track.interrupt();
    if (frame.pose) this.track.add(frame.t, frame.pose[0], frame.pose[1], frame.speed);
    this.figures.add(frame);
    this.lastT = frame.t;
  }

  addNews(news) {
    this.news.push(...news);
    this.newsCount += news.length;
    if (this.news.length > NEWS_KEPT) this.news = this.news.slice(-NEWS_KEPT);
  }
}
