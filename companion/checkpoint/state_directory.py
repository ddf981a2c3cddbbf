"""The directory of a rover's state file: where it is, its lock, and loading the state of a mission."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Mapping
from pathlib import Path

from companion.checkpoint.resume import PreviousRun, resumed_estimate
from companion.checkpoint.state_format import MAX_FILE_BYTES, DamagedStateError, StateError, decode_state
from companion.control.model_estimate import ModelEstimate
from companion.mission.identity import fingerprint
from companion.mission.mission import Mission
from companion.storage.files import NEW_SUFFIX, open_file, set_aside

NAME = "mission.state"
LOCK = "lock"


class StateDirectoryError(Exception):
    """A directory or state that cannot be used; the text is one line with the file, the reason and the remedy."""


def default_directory(environment: Mapping[str, str]) -> Path:
    """The directory that systemd made for the service, otherwise the user's own (XDG Base Directory Specification)."""
    if given := environment.get("STATE_DIRECTORY"):
        return Path(given.split(":")[0])
    base = environment.get("XDG_STATE_HOME", "")
    home = Path(base) if base.startswith("/") else Path(environment.get("HOME") or "/") / ".local" / "state"
    return home / "rover-companion"


def last_estimate(directory: Path) -> ModelEstimate | None:
    """How the rover follows velocities, as the run found whose state is kept there; None if nothing is to be had."""
    try:
        with open_file(directory / NAME) as file:
            state, _ = decode_state(file.read(MAX_FILE_BYTES))
    except (OSError, StateError):
        return None
    return None if state.estimate is None else resumed_estimate(state.estimate)


class StateDirectory:
    """One directory for one rover, used by one run at a time: it is created if necessary and locked until ``close``.

    Raises StateDirectoryError.
    """

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.file = directory / NAME
        self._lock: int | None = None
        try:
            directory.mkdir(mode=0o700, parents=True, exist_ok=True)
            self._lock = os.open(directory / LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self.file.with_name(NAME + NEW_SUFFIX).unlink(missing_ok=True)  # an earlier run was killed while writing
        except BlockingIOError:
            self.close()
            raise StateDirectoryError(
                f"{directory}: another run keeps its state here; stop it, or use --state DIR"
            ) from None
        except OSError as error:
            self.close()
            reason = error.strerror or error
            raise StateDirectoryError(
                f"{directory}: no state can be kept here: {reason}; choose another place with --state DIR"
            ) from error

    def load(self, mission: Mission) -> PreviousRun | None:
        """The run of this mission that was saved here; None if there is none. A damaged file is renamed.

        Raises StateDirectoryError.
        """
        try:
            run = PreviousRun(*decode_state(self._read()))
        except FileNotFoundError:
            return None
        except DamagedStateError as error:
            kept = set_aside(self.file, "damaged")
            raise StateDirectoryError(
                f"{self.file}: {error}; kept as {kept.name}; the next start begins the mission from its first target"
            ) from None
        except StateError as error:
            raise StateDirectoryError(
                f"{self.file}: {error}; use that version, or start without --resume to begin at the first target"
            ) from None
        except OSError as error:
            raise StateDirectoryError(
                f"{self.file}: cannot be read: {error.strerror or error}; remove it, or start without --resume"
            ) from None
        state = run.state
        if state.mission_sha256 != fingerprint(mission) or len(state.progress.statuses) != len(mission.targets):
            done = f"{state.reached} of {len(state.progress.statuses)} targets reached"
            raise StateDirectoryError(
                f"{self.file}: of another mission ('{state.mission}', {done}); "
                "resume that one, or start without --resume"
            )
        return run

    @property
    def before(self) -> Path:
        """Where an older state is kept when a mission begins at its first target."""
        return self.file.with_name(NAME + ".before")

    def close(self) -> None:
        """Release the lock."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def _read(self) -> bytes:
        with open_file(self.file) as file:
            data = file.read(MAX_FILE_BYTES + 1)
        if len(data) > MAX_FILE_BYTES:
            raise DamagedStateError("larger than any state file")
        return data
