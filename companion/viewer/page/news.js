// The list of news, newest first: time, level as colour and sign, text, and who said it.

import { make, setText } from "viewer/dom.js";
import { icon } from "viewer/icons.js";
import { clock } from "viewer/words.js";

const SHOWN = 500;
const LEVELS = new Set(["error", "warning", "notice", "info"]);

export class NewsList {
  /** `jump(t)`, of a report, makes each of the news a button that goes to its time. */
  constructor(model, jump) {
    Object.assign(this, { model, jump, shown: 0, last: null });
    this.node = make("ol", { class: "news", "aria-live": "off", "aria-label": "News" });
    this.none = make("li", { class: "nothing" }, "Nothing yet.");
    this.older = make("li", { class: "nothing" });
    this.node.append(this.none);
  }

  /** Adds what is new on top. Starts over when that does not continue what is shown: another run, seeking back. */
  show() {
    const { news, newsCount } = this.model;
    const fresh = newsCount - this.shown;
    if (fresh === 0 && news.at(-1) === this.last) return;
    const continues = fresh > 0 && fresh < news.length && news[news.length - fresh - 1] === this.last;
    const added = (continues ? news.slice(-fresh) : news.slice(-SHOWN)).reverse().map((one) => this.row(one));
    if (continues) this.node.prepend(...added);
    else this.node.replaceChildren(...(added.length ? added : [this.none]));
    this.older.remove();
    while (this.node.childElementCount > SHOWN) this.node.lastElementChild.remove();
    const left = newsCount - this.node.childElementCount;
    if (added.length && left > 0) {
      setText(this.older, `${left} older ones are not listed.`);
      this.node.append(this.older);
    }
    [this.shown, this.last] = [newsCount, news.at(-1)];
  }

  row(one) {
    const level = LEVELS.has(one.level) ? one.level : "info";
    const parts = [
      make("span", { class: "news-sign", title: level }, icon(level)),
      make("time", {}, clock(one.t, this.model.scene)),
      make("span", { class: "news-text" }, one.own === false ? make("b", {}, "Autopilot: ") : null, one.text),
    ];
    const inside = this.jump ? [make("button", { type: "button", onclick: () => this.jump(one.t) }, ...parts)] : parts;
    return make("li", { "data-level": level }, ...inside);
  }
}
