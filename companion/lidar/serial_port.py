"""A lidar's serial port, read by a thread, with reconnection of a cable that was pulled.

Nouns: serial port.
"""

from __future__ import annotations

import contextlib
import re
import threading
from collections import deque
from collections.abc import Sequence

import serial

from companion.core.clock import Clock
from companion.lidar.reader import Chunk, LidarPort
from companion.lidar.spec import LidarError, LidarSpec
from companion.mavlink.serial_port import open_reason

QUEUE_BYTES = 65_536
"""More than a second of the fastest lidar. What is older is dropped: nobody has come to read it."""
READ_BYTES = 4096
MOST_COMMANDS = 4
MOST_READS = 16
"""At once, until nothing waits any more: what waited is not new, only the last of it is."""
STEP_S = 0.005
"""Between two commands: a lidar needs some time after it was told to stop."""
WAIT_S = 0.02
"""A read waits no longer than this, so that bytes are stamped soon after they came."""
PAUSE_S = 0.005
"""Between two reads, so that the thread does not wake for every few bytes."""
RETRY_S = 0.5
CUT = b""

LISTEN_S = 0.4
LISTEN_BYTES = 2048


def listened(device: str, baud: int) -> bytes:
    """What comes on a port that nobody is told to begin on; empty if it cannot be opened."""
    try:
        with serial.Serial(device, baud, timeout=LISTEN_S, exclusive=True) as port:
            return bytes(port.read(LISTEN_BYTES))
    except (OSError, ValueError):
        return b""


class SerialLidarPort:
    """Opens the port at once; raises LidarError if that fails. Later it opens it again by itself."""

    def __init__(self, spec: LidarSpec, clock: Clock) -> None:
        self._spec = spec
        self._clock = clock
        self._queue: deque[Chunk] = deque()
        self._queued = 0
        self._lock = threading.Lock()
        self._closing = threading.Event()
        self._commands: deque[bytes] = deque(maxlen=MOST_COMMANDS)
        try:
            self._port: serial.Serial | None = self._opened()
        except (OSError, ValueError) as error:
            rated = re.search(r":\d+$", spec.port)
            reason = f"leave {rated[0]} out, the model says the baud rate" if rated else open_reason(error, spec.port)
            raise LidarError(f"lidar '{spec.text}': {spec.port} cannot be opened: {reason}") from error
        self._thread = threading.Thread(target=self._run, name=f"lidar {spec.port}", daemon=True)
        self._thread.start()

    def read(self) -> list[Chunk]:
        """What has come since the last call."""
        with self._lock:
            chunks, self._queued = list(self._queue), 0
            self._queue.clear()
        return chunks

    def write(self, data: bytes) -> None:
        """Have the thread send a command: a line may take its time. Dropped while the port is not there."""
        self._commands.append(data)

    def close(self) -> None:
        """Stop the lidar and close the port."""
        self._closing.set()
        self._thread.join(1.0)

    def _opened(self) -> serial.Serial:
        model = self._spec.model
        port = serial.Serial(None, model.baud, timeout=WAIT_S, write_timeout=0.1, exclusive=True)
        port.port, port.dtr = self._spec.port, model.dtr
        port.open()
        self._send(port, model.start)
        return port

    def _send(self, port: serial.Serial, commands: Sequence[bytes]) -> None:
        for number, command in enumerate(commands):
            if number:
                self._closing.wait(STEP_S)
            port.write(command)

    def _run(self) -> None:
        """The thread: reads until it is to end, and opens the port again when it was lost."""
        while not self._closing.is_set():
            port = self._port
            if port is None:
                self._commands.clear()
                self._closing.wait(RETRY_S)
                with contextlib.suppress(OSError, ValueError):
                    self._port = self._opened()
                    self._put(CUT)
                continue
            try:
                self._send(port, [self._commands.popleft() for _ in range(len(self._commands))])
                data = _waiting(port)
            except (OSError, TypeError):  # pyserial fails with a TypeError if the port is lost between two calls
                self._lose()
                continue
            if data:
                self._put(data)
                self._closing.wait(PAUSE_S)
        if self._port is not None:
            with contextlib.suppress(OSError, TypeError):
                self._send(self._port, self._spec.model.stop)
        self._lose()

    def _put(self, data: bytes) -> None:
        chunk = Chunk(self._clock.now_s(), data)
        with self._lock:
            if self._queued + len(data) > QUEUE_BYTES:
                self._queue.clear()
                self._queued = 0
                self._queue.append(Chunk(chunk.time_s, CUT))
            self._queue.append(chunk)
            self._queued += len(data)

    def _lose(self) -> None:
        port, self._port = self._port, None
        if port is not None:
            with contextlib.suppress(OSError):
                port.close()


def _waiting(port: serial.Serial) -> bytes:
    """All that has come, or the first byte to come; nothing after WAIT_S."""
    data = bytes(port.read(1))
    for _ in range(MOST_READS):
        waiting = port.in_waiting
        if not waiting:
            break
        data += port.read(min(waiting, READ_BYTES))
    return data


def open_ports(specs: Sequence[LidarSpec], clock: Clock) -> list[LidarPort]:
    """Open the ports of all; raises LidarError if one of them fails, or two share one."""
    ports: list[LidarPort] = []
    try:
        for spec in specs:
            ports.append(SerialLidarPort(spec, clock))
    except LidarError:
        for port in ports:
            port.close()
        raise
    return ports
