// The websocket to a live run. It connects again by itself, with growing waits, unless the token was refused.

const FIRST_WAIT_MS = 500;
const LONGEST_WAIT_MS = 5000;
const DENIED = 4401;
const TOO_MANY = 1013;

export class Link {
  /** `on` holds the functions opened(), message(object), tiles(buffer), closed(why) and denied(text). */
  constructor(address, on) {
    Object.assign(this, { address, on, token: null, wait: FIRST_WAIT_MS, socket: null, timer: 0 });
    // A phone that wakes up has lost its sockets and must not wait.
    const hurry = () => {
      if (document.visibilityState === "visible" && this.timer) this.connect();
    };
    document.addEventListener("visibilitychange", hurry);
    window.addEventListener("online", hurry);
  }

  connect() {
    clearTimeout(this.timer);
    this.timer = 0;
    this.drop();
    const socket = new WebSocket(this.address);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    this.refused = "";
    socket.addEventListener("open", () => {
      socket.send(JSON.stringify({ kind: "hello", token: this.token }));
      this.on.opened();
    });
    socket.addEventListener("message", (event) => this.hear(event.data));
    socket.addEventListener("close", (event) => this.end(socket, event.code));
  }

  hear(data) {
    this.wait = FIRST_WAIT_MS;
    if (data instanceof ArrayBuffer) {
      this.on.tiles(data);
      return;
    }
    const message = JSON.parse(data);
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
