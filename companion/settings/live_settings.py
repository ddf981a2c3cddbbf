"""The settings in force during a run: one holder, changed by one owner and read by all others.

Nouns: live settings.
"""

from __future__ import annotations

from companion.settings.settings import Settings


class LiveSettings:
    """Holds the settings in force. Read ``current`` when a setting is needed; a copy that is kept goes stale.

    The parameter server replaces them when a ground station changes a parameter.
    """

    def __init__(self, settings: Settings) -> None:
        self._current = settings
        self.changes = 0
        """How often they have been replaced: what is derived from them is made anew when this number has grown."""

    @property
    def current(self) -> Settings:
        """The settings that hold now."""
        return self._current

    def replace(self, settings: Settings) -> None:
        """Use other settings from now on."""
        self._current = settings
        self.changes += 1
