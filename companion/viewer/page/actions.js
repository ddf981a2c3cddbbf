// Buttons that tell the rover something: pause, go on, skip the target, go to a place. Only where the source allows it.

import { make, setAttribute, setText } from "viewer/dom.js";
import { distance } from "viewer/geometry.js";
import { icon, setIcon } from "viewer/icons.js";
import { metres, place as placeText, sentence } from "viewer/words.js";

const ANSWER_MS = 4000;
const TOAST_MS = 6000;
const NAMES = { pause: "Pause", resume: "Go on", skip: "Skip target", goto: "Send here" };

/** Why each action would do nothing now; empty for those that may be asked for. `old`: the frame is of seconds ago. */
export function locks(frame, connected, old = false) {
  const all = !connected ? "Not connected" : frame?.state === "ended" ? "The run has ended" : "";
  const late = all || (old ? "No data: what is shown here is old" : "");
  const begun = frame?.goal ? "" : "No target: the mission has not begun, or is over";
  const drives = frame?.drives === "companion" ? "" : "Only while the companion drives";
  return {
    pause: all, // never locked for another reason: whoever wants the rover to stop is not to be kept from it
    resume: late || (frame?.paused ? "" : "Not paused here"),
    skip: late || begun,
    goto: late || begun || drives,
  };
}

// Not "disabled": a locked button that is pressed says why it is locked, since a finger never hovers over it.
function lock(button, reason) {
  setAttribute(button, "aria-disabled", reason ? "true" : null);
  setAttribute(button, "title", reason || null);
}

export class Actions {
  /** `link` holds the functions send(message) and askToken(). */
  constructor(bar, stage, model, view, link) {
    Object.assign(this, { bar, stage, model, view, send: link.send, aiming: false, aim: null, confirmed: null });
    this.byAction = {};
    this.toast = make(
      "div",
      { class: "toast", role: "status", hidden: true },
      make("span", { class: "toast-sign" }),
      make("span"),
    );
    this.buttons = make(
      "div",
      { class: "actions", role: "toolbar", "aria-label": "Rover" },
      this.button("pause", "pause", () => this.act("pause")),
      this.button("resume", "play", () => this.act("resume")),
      this.button("skip", "skip", () => this.askSkip()),
      (this.goto = this.button("goto", "send", () => this.toggleAim())),
    );
    this.question = make("span", { class: "question" });
    this.yes = make("button", { type: "button", class: "strong", onclick: () => this.confirmed?.() });
    this.offer = make(
      "div",
      { class: "actions" },
      make("button", { type: "button", class: "wide", onclick: () => link.askToken() }, "Enter token to act"),
    );
    this.confirm = make(
      "div",
      { class: "confirm", hidden: true },
      this.question,
      this.yes,
      make("button", { type: "button", class: "wide", onclick: () => this.endAim() }, "Cancel"),
    );
    view.above.push((pen) => this.drawAim(pen));
    this.shown = null;
  }

  button(action, sign, onclick) {
    const parts = [icon(sign), make("span", {}, NAMES[action])];
    const press = () => {
      const reason = made.getAttribute("title");
      if (reason) this.say("warning", `${NAMES[action]}: ${reason[0].toLowerCase()}${reason.slice(1)}`);
      else onclick();
    };
    const made = make("button", { type: "button", class: "wide", onclick: press }, ...parts);
    this.byAction[action] = made;
    return made;
  }

  /** Shows the buttons where acting is allowed, and locks those that would do nothing now, with the reason. */
  show(scene, connected, old = false) {
    const allowed = scene?.may_act === true;
    const shown = allowed ? "all" : scene?.takes_actions === true ? "offer" : "none";
    if (shown !== this.shown) {
      this.shown = shown;
      const parts = { all: [this.toast, this.confirm, this.buttons], offer: [this.offer], none: [] };
      this.bar.replaceChildren(...parts[shown]);
    }
    const reasons = locks(this.model.frame, connected, old);
    // What is asked is of the moment when it was asked.
    const goal = this.model.frame?.goal?.name;
    const locked = locks(this.model.frame, true)[this.asks];
    if (!this.confirm.hidden && (!allowed || goal !== this.asked || locked)) this.endAim();
    for (const [action, button] of Object.entries(this.byAction)) lock(button, reasons[action]);
    this.yes.disabled = !connected || old;
  }

  act(action, place) {
    this.endAim(); // a question that is still open was asked before this
    // The goal that is shown now: by the time this arrives it may be another one.
    const goal = this.model.frame?.goal?.name ?? "";
    const message = { kind: "act", action, goal, t: this.model.frame?.t ?? null, ...(place && { place }) };
    if (!this.send(message)) {
      this.say("error", "Not sent: no connection");
      return;
    }
    this.say("notice", `${NAMES[action]}: sent`, false);
    clearTimeout(this.silence);
    this.silence = setTimeout(
      () => this.say("warning", `${NAMES[action]}: no answer. Sent once, not repeated.`),
      ANSWER_MS,
    );
  }

  /** An answer of the source. */
  take(answer) {
    clearTimeout(this.silence);
    const name = NAMES[answer.action] ?? answer.action;
    // What was refused stays until the next word: who asked for it may look elsewhere.
    this.say(answer.ok ? "good" : "error", `${name}: ${answer.text || (answer.ok ? "done" : "refused")}`, answer.ok);
  }

  say(level, text, ends = true) {
    this.toast.hidden = false;
    this.toast.dataset.level = level;
    setIcon(this.toast.firstElementChild, level);
    setText(this.toast.lastElementChild, sentence(text));
    clearTimeout(this.hide);
    if (ends)
      this.hide = setTimeout(() => {
        this.toast.hidden = true;
      }, TOAST_MS);
  }

  toggleAim() {
    if (this.aiming) {
      this.endAim();
      return;
    }
    this.aiming = true;
    this.asks = "goto";
    this.asked = this.model.frame?.goal?.name;
    this.toast.hidden = true;
    this.goto.setAttribute("aria-pressed", "true");
    this.stage.classList.add("aiming");
    this.ask("Now choose a place on the map.");
  }

  /** A tap on the map. Returns whether it was meant for this. */
  tap(x, y) {
    if (!this.aiming) return false;
    this.aim = this.view.camera.toPlace(x, y);
    const far = distance(this.model.frame?.pose, this.aim);
    const from = Number.isFinite(far) ? `, ${metres(far)} from the rover` : "";
    this.ask(`Send the rover to ${placeText(this.aim)}${from}?`, "Send", () => this.sendThere());
    this.view.invalidate();
    return true;
  }

  /** A question. `name` of the button that does it; without one the answer comes from the map. */
  ask(text, name = "", confirmed = null) {
    this.confirm.hidden = false;
    this.confirmed = confirmed;
    this.yes.hidden = confirmed === null;
    setText(this.yes, name);
    setText(this.question, text);
    if (confirmed) this.yes.focus();
  }

  askSkip() {
    this.endAim();
    const goal = this.model.frame?.goal?.name;
    this.asks = "skip";
    this.asked = goal;
    this.toast.hidden = true;
    this.ask(`Leave out ${goal}?`, "Skip", () => {
      this.endAim();
      this.act("skip");
    });
  }

  sendThere() {
    const place = this.aim?.map((value) => Math.round(value * 100) / 100);
    this.endAim();
    if (place) this.act("goto", place);
  }

  endAim() {
    [this.aiming, this.aim] = [false, null];
    this.goto.setAttribute("aria-pressed", "false");
    this.stage.classList.remove("aiming");
    this.confirm.hidden = true;
    this.view.invalidate();
  }

  drawAim(pen) {
    if (!this.aim) return;
    const [x, y] = pen.camera.toScreen(...this.aim);
    pen.context.beginPath();
    for (const [dx, dy] of [
      [1, 0],
      [-1, 0],
      [0, 1],
      [0, -1],
    ]) {
      pen.context.moveTo(x + dx * 6, y + dy * 6);
      pen.context.lineTo(x + dx * 22, y + dy * 22);
    }
    pen.stroke(pen.colours.halo, 7);
    pen.stroke(pen.colours.ink, 3);
    pen.disc(x, y, 14, null, pen.colours.ink, 2);
  }
}
