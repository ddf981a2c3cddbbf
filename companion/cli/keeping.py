"""``--state`` and ``--resume``: the state that ``run`` keeps, and the one it takes up."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from companion.checkpoint.checkpointer import Checkpointer
from companion.checkpoint.resume import PreviousRun
from companion.checkpoint.state_directory import StateDirectory, StateDirectoryError, default_directory
from companion.checkpoint.state_writer import StateFile, ThreadStateWriter
from companion.executive.mission_progress import TargetStatus
from companion.mission.mission import Mission
from companion.storage.beside import Patience
from companion.storage.disk import OsDisk


class Keeping:
    """The state of one run. A context manager: in the end what is left is written, and the directory is free for others.

    Nobody has to keep a state: where none was asked for, a place that cannot be used is only told (``say``). Otherwise raises StateDirectoryError.
    """

    def __init__(self, mission: Mission, directory: Path | None, *, resume: bool, say: Callable[[str], None]) -> None:
        self.checkpointer: Checkpointer | None = None
        self.previous: PreviousRun | None = None
        self._mission = mission
        self._resume = resume
        self._place: StateDirectory | None = None
        try:
            self._place = StateDirectory(directory or default_directory(os.environ))
            self._load(say)
        except StateDirectoryError as error:
            self.close()
            if directory is not None or resume:
                raise
            say(f"{error}; this run cannot be resumed")

    @property
    def ended(self) -> bool:
        """Whether there is nothing to take up, because that mission has been driven to its end."""
        return self.previous is not None and self.previous.state.ended

    @property
    def file(self) -> Path | None:
        """Where the state is kept; None if it is not."""
        return None if self._place is None else self._place.file

    @property
    def problem(self) -> str:
        """Why the state is not that of the end of the run, and what to do; empty while all is well."""
        if self.checkpointer is None or not self.checkpointer.problem or self.file is None:
            return ""
        stale = f", and do not --resume: {self.file.name} is older than this run" if self.file.exists() else ""
        return f"{self.checkpointer.problem}; make room there or name another place with --state DIR{stale}"

    @property
    def statuses(self) -> list[tuple[str, TargetStatus]]:
        """What became of the targets of a mission that has ended."""
        if self.previous is None:
            return []
        names = (target.name for target in self._mission.targets)
        return list(zip(names, self.previous.state.progress.statuses, strict=True))

    def start(self, patience: Patience | None = None) -> None:
        """From now on the state is written."""
        if self._place is not None:
            writer = ThreadStateWriter(StateFile(self._place.file, OsDisk()), patience)
            self.checkpointer = Checkpointer(self._mission, writer, self.previous)

    def close(self) -> None:
        """Write what is left."""
        if self.checkpointer is not None:
            self.checkpointer.close()
        if self._place is not None:
            self._place.close()

    def _load(self, say: Callable[[str], None]) -> None:
        assert self._place is not None
        if not self._resume:
            self._place.set_aside()
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
