"""The state directory of ``run`` (``--state``, ``--resume``): mission state, tuned settings, signing timestamp."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable
from pathlib import Path

from companion.checkpoint.checkpointer import Checkpointer
from companion.checkpoint.resume import PreviousRun
from companion.checkpoint.state_directory import StateDirectory, StateDirectoryError, default_directory
from companion.checkpoint.state_writer import StateFile, ThreadStateWriter
from companion.cli.inputs import OutputError, writable, written
from companion.executive.mission_progress import TargetStatus
from companion.mavlink.signing import Signer, load_key
from companion.mavlink.signing_time import TimeFile
from companion.mission.mission import Mission
from companion.settings import Settings
from companion.settings.tunable_parameters import as_toml, differences, with_tuned
from companion.storage.background_writer import BackgroundWriter, ShutdownBudget
from companion.storage.files import OsDisk

TUNED = "tuned.toml"
"""The file of settings changed by a ground station."""
SIGNING_TIME = "signing-time"
"""The file of the signing timestamp."""


class StateFiles:
    """Tuned settings and signing timestamp in a state directory; default: the user's."""

    def __init__(self, named: Path | None, budget: ShutdownBudget | None = None) -> None:
        """Raises OutputError if a named directory cannot be written."""
        self._directory = named or default_directory(os.environ)
        self._saver = BackgroundWriter(budget=budget)
        self._base = Settings()
        if named is not None and os.path.isfile(named):
            raise OutputError(f"{named}: is a file; --state takes a directory")
        self._made = [] if named is None else [one for one in (named, *named.parents) if not one.exists()]
        if named is not None and not named.is_dir():
            with written(named):
                named.mkdir(mode=0o700, parents=True)
        if named is not None:
            writable(named / TUNED)

    def settings(self, base: Settings, tell: Callable[[str], None]) -> Settings:
        """The settings with changes by ground stations in earlier runs. Raises SettingsError."""
        self._base = base
        settings = with_tuned(base, self._directory / TUNED)
        if tuned := differences(base, settings):
            tell(f"tuned from a ground station: {', '.join(tuned)}")
        return settings

    def keep(self, tuned: Settings) -> None:
        """Save tuned settings for the next run; returns at once."""
        self._saver.save(self._directory / TUNED, as_toml(self._base, tuned).encode())

    def signer(self, key_file: Path | None) -> Signer | None:
        """A signer with the key of a file; None without one. Raises SigningKeyError."""
        if key_file is None:
            return None
        return Signer(load_key(key_file), saved=TimeFile(self._directory / SIGNING_TIME, self._saver))

    def close(self) -> str:
        """Write what is left; returns why something could not be written, or an empty text.

        Of a run that never began no empty directories stay.
        """
        self._saver.close()
        with contextlib.suppress(OSError):  # there is something in it
            for made in self._made:
                made.rmdir()
        return self._saver.problem


class RunState:
    """The mission state that a run resumes and writes.

    Raises StateDirectoryError if a directory was named, or --resume given, and it cannot be used; else ``say`` reports
    that.
    """

    def __init__(self, mission: Mission, directory: Path | None, *, resume: bool, say: Callable[[str], None]) -> None:
        self.checkpointer: Checkpointer | None = None
        self.previous: PreviousRun | None = None
        self._mission = mission
        self._resume = resume
        self._named = directory is not None
        self._say = say
        self._place: StateDirectory | None = None
        self._written: StateFile | None = None
        try:
            self._place = StateDirectory(directory or default_directory(os.environ))
            self._load(say)
        except StateDirectoryError as error:
            self._do_without(error)

    @property
    def ended(self) -> bool:
        """Whether the resumed mission has been driven to its end already."""
        return self.previous is not None and self.previous.state.ended

    @property
    def file(self) -> Path | None:
        """The state file; None without one."""
        return None if self._place is None else self._place.file

    @property
    def problem(self) -> str:
        """Why the state is older than the end of the run, with remedy; empty if it is not."""
        if self.checkpointer is None or not self.checkpointer.problem or self.file is None:
            return ""
        stale = f", and do not --resume: {self.file.name} is older than this run" if self.file.exists() else ""
        return f"{self.checkpointer.problem}; make room there or name another place with --state DIR{stale}"

    @property
    def way_on(self) -> str:
        """How to go on with a run that was stopped; empty if there is nothing to go on with."""
        if self.checkpointer is None or self.checkpointer.problem or self._written is None:
            return ""
        if self.previous is None and not self._written.is_saved:
            return ""
        return "to go on where it was stopped: the same command with --resume"

    @property
    def statuses(self) -> list[tuple[str, TargetStatus]]:
        """The status of each target of a mission that has ended."""
        if self.previous is None:
            return []
        names = (target.name for target in self._mission.targets)
        return list(zip(names, self.previous.state.progress.statuses, strict=True))

    def start(self, budget: ShutdownBudget | None = None) -> None:
        """Start writing the state, when all else that a run needs is there.

        Without --resume an old state is set aside, but not before the mission begins.
        """
        if self._place is not None:
            before = None if self._resume else self._place.before
            self._written = StateFile(self._place.file, OsDisk(), before)
            self.checkpointer = Checkpointer(self._mission, ThreadStateWriter(self._written, budget), self.previous)

    def close(self) -> None:
        """Write what is left."""
        if self.checkpointer is not None:
            self.checkpointer.close()
        if self._place is not None:
            self._place.close()

    def _do_without(self, error: StateDirectoryError) -> None:
        self.close()
        self._place = None
        if self._named or self._resume:
            raise error
        self._say(f"{error}; this run cannot be resumed")

    def _load(self, say: Callable[[str], None]) -> None:
        if not self._resume or self._place is None:
            return
        self.previous = self._place.load(self._mission)
        if self.previous is None:
            say(f"no state in {self._place.directory}: the mission begins at its first target")
            return
        state = self.previous.state
        what = "was driven to its end" if state.ended else "goes on"
        say(f"{self._mission.name} {what}: {state.reached} of {len(state.progress.statuses)} targets reached")
        if state.ended:
            say("to drive it again, start without --resume")
