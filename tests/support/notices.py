"""Stands in for the notifier and for a clock."""

from __future__ import annotations

from dataclasses import dataclass, field

from companion.core.severity import Severity


@dataclass
class Notices:
    """Keeps what people would be told."""

    told: list[tuple[str, Severity]] = field(default_factory=list)

    def tell(self, text: str, severity: Severity) -> None:
        self.told.append((text, severity))

    def once(self, text: str) -> None:
        if text not in self.texts:
            self.tell(text, Severity.WARNING)

    @property
    def texts(self) -> list[str]:
        return [text for text, _ in self.told]


@dataclass
class HandClock:
    """Shows what it is set to; only sleeping moves it on."""

    time_s: float = 0.0

    def now_s(self) -> float:
        return self.time_s

    def sleep_until_s(self, time_s: float) -> None:
        self.time_s = max(self.time_s, time_s)
