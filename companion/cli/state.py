"""What ``rover-companion run`` keeps beyond its end, in the directory that ``--state`` names, and the signing that needs it."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from companion.checkpoint.state_directory import default_directory
from companion.cli.inputs import OutputError, writable
from companion.mavlink.signing import Signer, load_key
from companion.mavlink.signing_time import TimeFile
from companion.settings import Settings
from companion.settings.tunable_parameters import as_toml, differences, with_tuned
from companion.storage.beside import Patience
from companion.storage.saving import Saver

TUNED = "tuned.toml"
"""Settings that a ground station has changed."""
SIGNING_TIME = "signing-time"
"""The signing timestamp, saved ahead."""


class StateFiles:
    """The small files of a state directory; the default one, if none is named."""

    def __init__(self, named: Path | None, patience: Patience | None = None) -> None:
        """Raises OutputError if nothing can be written in a directory that was named."""
        self._directory = named or default_directory(os.environ)
        self._saver = Saver(patience=patience)
        self._base = Settings()
        if named is not None and named.exists() and not named.is_dir():
            raise OutputError(f"{named}: is a file; --state takes a directory")
        if named is not None:
            writable(named / TUNED)

    def settings(self, base: Settings, tell: Callable[[str], None]) -> Settings:
        """The settings with what ground stations have changed in earlier runs. Raises SettingsError."""
        self._base = base
        settings = with_tuned(base, self._directory / TUNED)
        if tuned := differences(base, settings):
            tell(f"tuned from a ground station: {', '.join(tuned)}")
        return settings

    def keep(self, tuned: Settings) -> None:
        """Keep them for the next run; returns at once."""
        self._saver.save(self._directory / TUNED, as_toml(self._base, tuned).encode())

    def signer(self, key_file: Path | None) -> Signer | None:
        """Signs with the key of a file, None without one. Raises SigningKeyError."""
        if key_file is None:
            return None
        return Signer(load_key(key_file), saved=TimeFile(self._directory / SIGNING_TIME, self._saver))

    def close(self) -> str:
        """Write what is left; why something could not be written, or nothing."""
        self._saver.close()
        return self._saver.problem
