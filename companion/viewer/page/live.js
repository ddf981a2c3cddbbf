// The live page: connects to a run and shows it, and says so when what is shown is no longer fresh.

import { Actions } from "viewer/actions.js";
import { Camera } from "viewer/camera.js";
import { Charts } from "viewer/charts.js";
import { addFiguresButton } from "viewer/figures_button.js";
import { isLost, silence } from "viewer/freshness.js";
import { listen, listenKeys } from "viewer/gestures.js";
import { Link } from "viewer/link.js";
import { MapView } from "viewer/map_view.js";
import { Model } from "viewer/model.js";
import { drawContacts } from "viewer/overlays.js";
import { Panel } from "viewer/panel.js";
import { buildShell, watchEdges } from "viewer/shell.js";
import { askToken, findToken, forgetToken } from "viewer/token.js";
import { lasting } from "viewer/words.js";

/** Frames come five a second. Without one for as long as this, what is shown is old. */
const STALE_MS = 1500;
const LOOK_MS = 250;

class LivePage {
  constructor(root) {
    this.model = new Model();
    this.camera = new Camera();
    this.parts = buildShell(root, this.camera);
    const { canvas, bar, charts, panel, viewer } = this.parts;
    this.view = new MapView(canvas, this.model, this.camera);
    this.view.above.push((pen) => drawContacts(pen, this.model.frame?.touched ?? []));
    this.panel = new Panel(this.model, { go: (place) => this.camera.centre(place) });
    panel.append(this.panel.node);
    this.charts = new Charts(charts, this.model);
    this.actions = new Actions(bar, viewer, this.model, this.view, {
      send: (message) => this.link.send(message),
      askToken: () => this.askToAct("Whoever knows it may act."),
    });
    addFiguresButton(this.parts);
    watchEdges(this.parts, this.view);
    listen(canvas, this.camera, (x, y) => this.actions.tap(x, y));
    this.parts.keys.Escape = () => {
      this.parts.legend.close();
      this.actions.endAim();
    };
    listenKeys(canvas, this.camera, this.parts.keys);
    this.heard = performance.now();
    this.wrong = ""; // why a token was refused, until somebody is asked for another one
    this.connect();
  }

  connect() {
    const address = new URL("ws", location.href);
    address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    address.hash = "";
    this.link = new Link(address.href, {
      opened: () => this.model.connected(),
      message: (message) => this.take(message),
      tiles: (buffer) => this.model.takeTiles(buffer),
      closed: (why) => this.leave(why),
      denied: (text) => this.deny(text),
    });
    this.link.token = findToken();
    window.addEventListener("hashchange", () => this.takeToken()); // an address with a token, opened in the same tab
    this.model.listeners.add(() => this.later());
    setInterval(() => this.refresh(), LOOK_MS);
    this.link.connect();
  }

  takeToken() {
    const token = findToken();
    if (token === null || token === this.link.token) return;
    this.parts.viewer.querySelector(".token-form")?.remove();
    this.enter(token);
  }

  deny(text) {
    forgetToken();
    if (this.link.token) {
      this.wrong = text;
      this.enter(null); // whoever may look on without a token goes on looking
      return;
    }
    this.denied = true;
    this.refresh();
    this.askToken(this.wrong || text, null);
    this.wrong = "";
  }

  leave(why) {
    this.why = why;
    this.refresh();
  }

  askToken(text, cancelled) {
    askToken(this.parts.viewer, text, (token) => this.enter(token), cancelled);
  }

  askToAct(text) {
    this.askToken(text, () => {});
  }

  enter(token) {
    this.denied = false;
    this.link.token = token;
    this.link.connect();
  }

  take(message) {
    if (message.kind === "answer") this.actions.take(message);
    else this.model.take(message);
    if (message.kind === "scene" && this.wrong) {
      this.askToAct(this.wrong);
      this.wrong = "";
    }
    if (message.kind === "frame") this.heard = performance.now();
  }

  // Many messages may come at once after a connection; the page is brought up to date once for all of them.
  later() {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => {
      this.pending = false;
      this.refresh();
    });
  }

  refresh() {
    const { viewer, headline, legend } = this.parts;
    const { scene, frame } = this.model;
    const trouble = this.trouble();
    const lost = isLost(frame);
    const old = frame !== null && this.silentFor() > STALE_MS;
    const silent = trouble !== "" || (old && frame.state !== "ended"); // what a run has come to stays true
    this.charts.stale = lost || silent;
    viewer.classList.toggle("stale", this.charts.stale);
    viewer.classList.toggle("lost", lost && !silent); // where it is, is old; mode and battery are not
    if (viewer.classList.contains("truth") !== (scene?.truth === true)) {
      viewer.classList.toggle("truth");
      this.charts.resize(); // there are fewer of them, or more
    }
    headline.show(scene, frame, trouble, this.link?.open === true);
    legend.show(scene);
    this.panel.show();
    this.charts.show();
    this.actions.show(scene, this.link?.open === true, old);
  }

  silentFor() {
    return performance.now() - this.heard;
  }

  /** Why what is shown is not to be believed, or an empty text. A run that has ended stays ended. */
  trouble() {
    if (this.denied) return "Not connected: a token is needed";
    const silent = this.silentFor();
    if (this.model.frame?.state === "ended") return "";
    if (silent < STALE_MS) return silence(this.model.frame);
    const time = lasting(silent / 1000);
    if (this.link?.open) return this.model.frame ? `No data for ${time}` : "";
    return `${this.why || "No connection"} for ${time}`;
  }
}

new LivePage(document.getElementById("app"));
