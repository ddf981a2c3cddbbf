"""A crowd that looks at a live page: ``python -m tests.support.crowd PORT COUNT``, until its standard input ends.

COUNT browsers read everything. One more never reads, and one sends garbage. Who loses the connection comes again. Plain
sockets, so that the crowd itself hardly costs anything; in the end it prints as JSON what each reader got.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import random
import sys

AGAIN_S, GARBAGE_S = 0.3, 0.1
HELLO = b'{"kind":"hello"}'
READ_BYTES = 1 << 16


def upgrade(port: int) -> bytes:
    """The request that opens a web socket."""
    lines = (
        "GET /ws HTTP/1.1",
        f"Host: 127.0.0.1:{port}",
        "Connection: Upgrade",
        "Upgrade: websocket",
        "Sec-WebSocket-Version: 13",
        f"Sec-WebSocket-Key: {'A' * 22}==",
        "",
        "",
    )
    return "\r\n".join(lines).encode()


def text_frame(text: bytes) -> bytes:
    """A short text as a browser sends it, under a mask of zeros."""
    return bytes([0x81, 0x80 | len(text)]) + bytes(4) + text


async def _connected(port: int, limit: int = READ_BYTES) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    reader, writer = await asyncio.open_connection("127.0.0.1", port, limit=limit)
    writer.write(upgrade(port))
    await reader.readuntil(b"\r\n\r\n")
    writer.write(text_frame(HELLO))
    return reader, writer


async def _reads(port: int, got: list[int]) -> None:
    """Counts in ``got`` the bytes of each connection."""
    reader, writer = await _connected(port)
    got.append(0)
    try:
        while data := await reader.read(READ_BYTES):
            got[-1] += len(data)
    finally:
        writer.close()


async def _never_reads(port: int) -> None:
    reader, writer = await _connected(port, 1024)
    try:
        while not reader.at_eof():
            await asyncio.sleep(1.0)
    finally:
        writer.close()


async def _sends_garbage(port: int, rng: random.Random) -> None:
    reader, writer = await _connected(port)
    try:
        while not reader.at_eof():
            writer.write(rng.choice([rng.randbytes(500), text_frame(b'{"kind":"act"}'), text_frame(b"[" * 100)]))
            await writer.drain()
            with contextlib.suppress(asyncio.TimeoutError):
                await asyncio.wait_for(reader.read(READ_BYTES), GARBAGE_S)
    finally:
        writer.close()


async def _for_ever(once) -> None:
    while True:
        with contextlib.suppress(OSError, EOFError):
            await once()
        await asyncio.sleep(AGAIN_S)


async def main(port: int, count: int) -> None:
    got: list[list[int]] = [[] for _ in range(count)]
    rng = random.Random(0)
    tasks = [asyncio.create_task(_for_ever(lambda mine=mine: _reads(port, mine))) for mine in got]
    tasks.append(asyncio.create_task(_for_ever(lambda: _never_reads(port))))
    tasks.append(asyncio.create_task(_for_ever(lambda: _sends_garbage(port, rng))))
    await asyncio.to_thread(sys.stdin.read)
    print(json.dumps(got), flush=True)
    os._exit(0)


if __name__ == "__main__":
    asyncio.run(main(int(sys.argv[1]), int(sys.argv[2])))
