// The websocket to a live run. It connects again by itself, with growing waits, unless the token was refused.

const FIRST_WAIT_MS = 500;
const LONGEST_WAIT_MS = 5000;
const DENIED = 4401;
const TOO_MANY = 1013;
/** The server says something every 2 seconds, whatever happens; a look without a word comes once a second. */
const LOOK_MS = 1000;
/** After so many looks without a word the other end is gone: out of range, nobody ends a connection. */
const MOST_QUIET = 6;
/** Over a slow link the first message may take longer, so patience grows with each connection that is given up. */
const LONGEST_QUIET = 48;
/** A page that comes back to the front, or onto a network, waits for so many looks at most. */
const QUIET_LEFT = 4;

export class Link {
  /** Messages of kind "beat" say only that somebody is there. `on` holds the functions opened(), message(object), tiles(buffer), closed(why) and denied(text). */
  constructor(address, on) {
    Object.assign(this, { address, on, token: null, wait: FIRST_WAIT_MS, socket: null, timer: 0 });
    Object.assign(this, { quiet: 0, patience: MOST_QUIET });
    // A phone that wakes up has lost its sockets and must not wait.
    const hurry = () => {
      if (document.visibilityState !== "visible") return;
      if (this.timer) this.connect();
      else this.quiet = Math.max(this.quiet, this.patience - QUIET_LEFT);
    };
    setInterval(() => this.look(), LOOK_MS);
    document.addEventListener("visibilitychange", hurry);
    window.addEventListener("online", hurry);
  }

  connect() {
    clearTimeout(this.timer);
    this.timer = 0;
    this.drop();
    this.quiet = 0;
    const socket = new WebSocket(this.address);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    this.refused = "";
    socket.addEventListener("open", () => {
      socket.send(JSON.stringify({ kind: "hello", token: this.token }));
      this.quiet = 0;
      this.on.opened();
    });
    socket.addEventListener("message", (event) => {
      if (socket === this.socket) this.hear(event.data);
    });
    socket.addEventListener("close", (event) => this.end(socket, event.code));
  }

  // Looks are counted, not time: a page that the browser has held up has not listened.
  look() {
    if (!this.socket) return;
    this.quiet += 1;
    if (this.quiet < this.patience) return;
    if (this.open) this.patience = Math.min(LONGEST_QUIET, 2 * this.patience);
    const socket = this.socket;
    this.end(socket, 0);
    socket.close();
  }

  hear(data) {
    this.wait = FIRST_WAIT_MS;
    this.quiet = 0;
    if (data instanceof ArrayBuffer) {
      this.on.tiles(data);
      return;
    }
    const message = JSON.parse(data);
    if (message.kind === "frame" || message.kind === "beat") this.patience = MOST_QUIET;
    if (message.kind === "denied") this.refused = message.text || "A token is needed.";
    else this.on.message(message);
  }

  end(socket, code) {
    if (socket !== this.socket) return;
    this.socket = null;
    this.on.closed(code === TOO_MANY ? "Too many browsers look on" : "");
    if (code === DENIED || this.refused) {
      this.on.denied(this.refused || "A token is needed.");
      return;
    }
    this.timer = setTimeout(() => this.connect(), this.wait);
    this.wait = Math.min(LONGEST_WAIT_MS, this.wait * 1.6);
  }

  drop() {
    const socket = this.socket;
    this.socket = null;
    socket?.close();
  }

  get open() {
    return this.socket?.readyState === WebSocket.OPEN;
  }

  /** Sends a message; false when there is no connection. Nothing is kept for later: an old command is a danger. */
  send(message) {
    if (!this.open) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }
}
