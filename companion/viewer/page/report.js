// The report: one record in one file, seen at any moment.

import { Camera } from "viewer/camera.js";
import { Charts } from "viewer/charts.js";
import { Decisions } from "viewer/decisions.js";
import { make } from "viewer/dom.js";
import { addFiguresButton } from "viewer/figures_button.js";
import { isLost, silence } from "viewer/freshness.js";
import { listen, listenKeys } from "viewer/gestures.js";
import { MapView } from "viewer/map_view.js";
import { Model } from "viewer/model.js";
import { claimHappenings, drawHappenings, Others } from "viewer/overlays.js";
import { Panel } from "viewer/panel.js";
import { Playback } from "viewer/playback.js";
import { readRecord, Record } from "viewer/record.js";
import { buildShell, watchEdges } from "viewer/shell.js";
import { buildTables } from "viewer/tables.js";
import { Tabs } from "viewer/tabs.js";
import { Timeline } from "viewer/timeline.js";

const TRACK_REACH_PX = 16;
/** While playing, the panel is brought up to date this often; the map in every picture. */
const PANEL_MS = 100;
const SECOND_STEP_S = 1;

class ReportPage {
  constructor(root, record) {
    this.record = record;
    this.model = new Model();
    record.fill(this.model);
    this.camera = new Camera();
    this.parts = buildShell(root, this.camera);
    this.playback = new Playback(record.begin, record.end);
    this.view = new MapView(this.parts.canvas, this.model, this.camera);
    this.buildPanel();
    this.timeline = new Timeline(this.parts.strip, record, this.playback, (way) =>
      this.decisions.step(this.playback.t, way),
    );
    this.charts = new Charts(this.parts.charts, this.model, (t) => this.jump(t));
    addFiguresButton(this.parts);
    watchEdges(this.parts, this.view);
    this.drawExtras();
    listen(this.parts.canvas, this.camera, (x, y) => this.tap(x, y));
    this.addKeys();
    this.shownAt = -Infinity;
    this.playback.listeners.add(() => this.show());
    this.playback.seek(record.end); // what it came to is asked for first; playing begins at the beginning
  }

  buildPanel() {
    const { record, parts } = this;
    const jump = (t) => this.jump(t);
    this.panel = new Panel(this.model, { go: (place) => this.camera.centre(place), jump });
    this.decisions = new Decisions(record, jump);
    this.others = new Others(record.others, record.begin, () => this.view.invalidate());
    this.panel.node.prepend(this.others.node);
    this.tabs = new Tabs(
      parts.panel,
      [
        ["Now", this.panel.node],
        ["Decisions", this.decisions.node],
        ["Tables", buildTables(record)],
      ],
      (name) => this.choose(name),
    );
  }

  choose(name) {
    if (name === "Decisions") this.decisions.showList(); // what is not seen cannot be scrolled
    this.view.invalidate();
  }

  get choosing() {
    return this.tabs.chosen === "Decisions";
  }

  // Stops and places of contacts up to now, and where the rover is.
  happenings() {
    const past = (list) => list.filter((one) => one.place && one.t <= this.playback.t);
    const stops = past(this.record.events.filter((event) => event.kind === "stop"));
    return [stops, past(this.record.contacts).map((one) => one.place), this.model.frame?.pose];
  }

  drawExtras() {
    this.view.besides.push(() => (this.choosing ? [] : this.others.places()));
    // Candidates and other records together would be a tangle of lines.
    this.view.below.push((pen) => {
      claimHappenings(pen, ...this.happenings());
      if (!this.choosing) this.others.drawTracks(pen);
    });
    this.view.between.push((pen) => {
      if (this.choosing) this.decisions.drawLines(pen); // no name of a target lies under them
    });
    this.view.above.push((pen) => {
      drawHappenings(pen, ...this.happenings());
      if (this.choosing) this.decisions.drawCosts(pen);
      else this.others.drawPlaces(pen, this.playback.t);
    });
    this.decisions.changed = () => this.view.invalidate();
  }

  addKeys() {
    const { keys, legend } = this.parts;
    keys[" "] = () => this.playback.toggle();
    keys["["] = () => this.decisions.step(this.playback.t, -1);
    keys["]"] = () => this.decisions.step(this.playback.t, 1);
    keys[","] = () => this.jump(this.playback.t - SECOND_STEP_S);
    keys["."] = () => this.jump(this.playback.t + SECOND_STEP_S);
    legend.addSign("halted", "stop, or held up on the way");
    legend.addKeys(", Space play, , and . a second back or on, [ and ] decision before or after");
    listenKeys(this.parts.canvas, this.camera, keys);
  }

  /** Goes to a time and stays there. */
  jump(t) {
    this.playback.playing = false;
    this.playback.seek(t);
  }

  // A press on the track goes to the time when the rover was there.
  tap(x, y) {
    const t = this.model.track.nearest(this.camera, x, y, TRACK_REACH_PX);
    if (t !== null) this.jump(t);
  }

  show() {
    this.record.show(this.model, this.playback.t);
    this.timeline.show();
    const now = performance.now();
    if (this.playback.playing && now - this.shownAt < PANEL_MS) return;
    this.shownAt = now;
    const { scene, frame } = this.model;
    const cut = this.record.scene.cut === true && this.playback.t >= this.record.end;
    const silent = silence(frame);
    this.parts.viewer.classList.toggle("stale", cut || silent !== "" || isLost(frame));
    this.parts.viewer.classList.toggle("lost", silent === "" && isLost(frame));
    const ending = "The record was cut short here: killed, power lost, or the disk full";
    const shown = frame && { ...frame, t: this.playback.t }; // the slider's time
    this.parts.headline.show(scene, shown, cut ? ending : silent);
    this.panel.show();
    this.decisions.show(this.playback.t);
    this.charts.show();
  }
}

async function begin() {
  const root = document.getElementById("app");
  try {
    new ReportPage(root, new Record(await readRecord(document.getElementById("record"))));
  } catch (error) {
    root.replaceChildren(make("p", { class: "broken" }, `This report cannot be shown: ${error.message}`));
    throw error;
  }
}

begin();
