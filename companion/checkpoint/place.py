"""Where states are kept: one directory for one rover, used by one run at a time."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Mapping
from pathlib import Path

from companion.checkpoint.format import MAX_FILE_BYTES, DamagedError, Raster, StateError, decoded
from companion.checkpoint.model import SavedState
from companion.mission.identity import fingerprint
from companion.mission.mission import Mission
from companion.storage.disk import BESIDE, OsDisk, set_aside
from companion.storage.reading import open_file

NAME = "mission.state"
LOCK = "lock"


class StatePlaceError(Exception):
    """A directory or state that cannot be used; the text is one line with the file, the reason and the remedy."""


def default_directory(environment: Mapping[str, str]) -> Path:
    """What systemd has made for the service, else the user's own place for states (XDG)."""
    if given := environment.get("STATE_DIRECTORY"):
        return Path(given.split(":")[0])
    base = environment.get("XDG_STATE_HOME", "")
    home = Path(base) if base.startswith("/") else Path(environment.get("HOME") or "/") / ".local" / "state"
    return home / "rover-companion"


class StatePlace:
    """The directory, made if need be, and locked for as long as this lives. Raises StatePlaceError."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.file = directory / NAME
        self._lock: int | None = None
        try:
            directory.mkdir(mode=0o700, parents=True, exist_ok=True)
            self._lock = os.open(directory / LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self.file.with_name(NAME + BESIDE).unlink(missing_ok=True)  # an earlier run was killed while it wrote
        except BlockingIOError:
            self.close()
            raise StatePlaceError(
                f"{directory}: another run keeps its state here; stop it, or use --state DIR"
            ) from None
        except OSError as error:
            self.close()
            raise StatePlaceError(
                f"{directory}: no state can be kept here: {error.strerror or error}; choose another place with --state DIR"
            ) from error

    def load(self, mission: Mission) -> tuple[SavedState, dict[str, Raster]] | None:
        """The state of this mission; None when there is none. Raises StatePlaceError; a damaged file is renamed first."""
        try:
            state, rasters = decoded(self._read())
        except FileNotFoundError:
            return None
        except DamagedError as error:
            kept = set_aside(self.file, "damaged")
            raise StatePlaceError(
                f"{self.file}: {error}; kept as {kept.name}; the next start begins the mission from its first target"
            ) from None
        except StateError as error:
            raise StatePlaceError(
                f"{self.file}: {error}; use that version, or start without --resume to begin anew"
            ) from None
        except OSError as error:
            raise StatePlaceError(
                f"{self.file}: cannot be read: {error.strerror or error}; remove it, or start without --resume"
            ) from None
        if state.mission_sha256 != fingerprint(mission) or len(state.progress.statuses) != len(mission.targets):
            done = f"{state.reached} of {len(state.progress.statuses)} targets reached"
            raise StatePlaceError(
                f"{self.file}: of another mission ('{state.mission}', {done}); resume that one, or start without --resume"
            )
        return state, rasters

    def begin_anew(self) -> Path | None:
        """A mission is begun at its first target: a state that is there is kept under another name, which is returned."""
        try:
            before = self.file.with_name(NAME + ".before")
            self.file.replace(before)
            OsDisk().sync_directory(self.directory)
        except FileNotFoundError:
            return None
        except OSError as error:
            raise StatePlaceError(f"{self.file}: cannot be renamed: {error.strerror or error}; remove it") from None
        return before

    def close(self) -> None:
        """Let others use it."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def _read(self) -> bytes:
        with open_file(self.file) as file:
            data = file.read(MAX_FILE_BYTES + 1)
        if len(data) > MAX_FILE_BYTES:
            raise DamagedError("larger than any state is")
        return data
