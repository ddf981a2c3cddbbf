"""A simulated lidar on a pseudo-terminal, which a companion opens like a serial device.

Nouns: lidar terminal.
"""

from __future__ import annotations

import contextlib
import os
import tty
from collections.abc import Callable
from pathlib import Path

from sitl.network.endpoint import LINK_REMEDY, READ_BYTES, ListenError
from sitl.sensors.serial_lidar import SerialLidar
from sitl.simulator import Simulator

TERMINALS = "/dev/pts/"


class LidarTerminal:
    """An endpoint of the server: the far end of a lidar's serial line.

    A cable that is pulled closes the pseudo-terminal. Put in again, it is another one: only a symbolic link at a path
    of one's own leads there, as a rule of udev does for a real adapter.
    """

    def __init__(self, device: SerialLidar, path: str, tell: Callable[[str], None]) -> None:
        """``path``: of the symbolic link; empty for none. ``tell``: where the terminal is. Raises ListenError."""
        self._device = device
        self._path = Path(path) if path else None
        self._tell = tell
        self._ours: int | None = None
        self._theirs = -1
        self._name = ""
        try:
            self._open()
        except OSError as error:
            remedy = f"; {LINK_REMEDY}" if path else ""
            name = path or device.mounted.make.name
            raise ListenError(f"--lidar-pty: {name}: {error.strerror or error}{remedy}") from error

    def descriptors(self) -> list[int]:
        """The near end, unless the cable is pulled."""
        return [] if self._ours is None else [self._ours]

    def exchange(self, simulator: Simulator, now_s: float) -> None:
        """Hand commands to the lidar, and its bytes to whoever has opened the far end; what does not fit is lost."""
        if not self._device.plugged:
            self.close()
            return
        if self._ours is None:
            with contextlib.suppress(OSError):  # no terminal is free: again at the next round
                self._open()
            return
        with contextlib.suppress(BlockingIOError, OSError):
            self._device.hear(os.read(self._ours, READ_BYTES))
        data = self._device.take()
        with contextlib.suppress(BlockingIOError, OSError):
            os.write(self._ours, data)

    def close(self) -> None:
        """Close both ends and remove the link, if it is still ours."""
        if self._ours is None:
            return
        if self._path is not None and self._path.is_symlink() and os.readlink(self._path) == self._name:
            self._path.unlink()
        os.close(self._ours)
        os.close(self._theirs)
        self._ours = None

    def _open(self) -> None:
        ours, theirs = os.openpty()
        try:
            tty.setraw(theirs)
            os.set_blocking(ours, False)
            name = os.ttyname(theirs)
            self._link(name)
        except OSError:
            os.close(ours)
            os.close(theirs)
            raise
        self._ours, self._theirs, self._name = ours, theirs, name
        place = name if self._path is None else f"{self._path} ({name})"
        self._tell(f"{self._device.mounted.make.name} on {place}")

    def _link(self, name: str) -> None:
        """Make the symbolic link; one that a killed simulator left behind is replaced. Raises OSError."""
        if self._path is None:
            return
        if self._path.is_symlink():
            target = os.readlink(self._path)
            if target == name or (target.startswith(TERMINALS) and not self._path.exists()):
                self._path.unlink()
        self._path.symlink_to(name)
