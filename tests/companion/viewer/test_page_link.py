"""The page's websocket: a connection that nobody ends and on which nothing is heard is dropped and opened anew."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.page_script import needs_node, ran

pytestmark = needs_node

BROWSER = """
const timers = { now: 0, all: [] };
const add = (act, ms, again) => timers.all.push({ act, at: timers.now + ms, again }) && timers.all.at(-1);
Object.assign(globalThis, {
  setTimeout: (act, ms) => add(act, ms, 0), setInterval: (act, ms) => add(act, ms, ms),
  clearTimeout: (one) => { timers.all = timers.all.filter((other) => other !== one); },
});
const run = (ms) => {
  for (const end = timers.now + ms; timers.now < end; ) {
    timers.now += 100;
    for (const one of timers.all.filter((one) => one.at <= timers.now)) {
      if (one.again) one.at += one.again; else clearTimeout(one);
      one.act();
    }
  }
};
const sockets = [], happened = {};
class Socket extends EventTarget {
  static OPEN = 1;
  constructor() { super(); this.readyState = 0; this.born = timers.now; sockets.push(this); }
  send() {}
  close() { this.closed = timers.now; }
  opens() { this.readyState = 1; this.dispatchEvent(new Event("open")); }
  says(kind) { this.dispatchEvent(Object.assign(new Event("message"), { data: JSON.stringify({ kind }) })); }
}
globalThis.WebSocket = Socket;
globalThis.document = Object.assign(new EventTarget(), { visibilityState: "visible" });
globalThis.window = new EventTarget();
const { Link } = await import("./link.js");
let closed = 0;
const nothing = () => {};
const link = new Link("ws://x/ws", {
  opened: nothing, message: nothing, tiles: nothing, denied: nothing, closed: () => { closed += 1; },
});
link.connect();
sockets[0].opens();
const fresh = () => {
  while (!link.socket) run(100);
  return link.socket;
};
"""


def test_a_connection_without_a_word_is_opened_anew_and_not_in_a_tight_loop(tmp_path: Path) -> None:
    told = ran(
        tmp_path,
        BROWSER
        + """
for (let i = 0; i < 20; i++) { sockets[0].says("beat"); run(2000); }
const first = [sockets.length, closed];
run(10000);
const second = [sockets.length, closed, sockets[0].closed - 38000 <= 8000];
run(60000); // nobody answers: out of range
const socket = fresh();
socket.opens();
socket.says("frame");
sockets[0].says("frame");
const third = sockets.length;
run(4000);
tell([first, second, third, sockets.length - third, link.open]);
""",
    )
    assert told[:2] == [[1, 0], [2, 1, True]]
    assert 5 <= told[2] <= 12 and told[3:] == [0, True]


@pytest.mark.parametrize("event", ["online", "visibilitychange"])
def test_a_phone_that_wakes_up_waits_less(tmp_path: Path, event: str) -> None:
    target = "window" if event == "online" else "document"
    script = f"run(2000); {target}.dispatchEvent(new Event('{event}')); run(4500); tell(sockets[0].closed ?? null)"
    assert ran(tmp_path, BROWSER + script) is not None


def test_a_slow_link_is_given_more_time_with_each_connection(tmp_path: Path) -> None:
    script = """
let tries = 0;
for (let kept = false; !kept && tries < 10; tries++) {
  const socket = fresh();
  if (tries) socket.opens();
  socket.says("scene");
  run(15000); // so long the past takes
  kept = socket.closed === undefined;
}
tell(tries);
"""
    assert 2 <= ran(tmp_path, BROWSER + script) <= 4
