"""The mission of a run: from a file, or downloaded from the autopilot."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from companion.core.clock import WallClock
from companion.executive.autopilot_mission import MissionFetcher
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mavlink.codec import Codec
from companion.mavlink.signing import Signer
from companion.mavlink.transport import ByteLink, open_link
from companion.mission.doubtful_places import doubtful_places, home_at_edge
from companion.mission.given import NOTHING_GIVEN, Given, with_given
from companion.mission.load import load_mission
from companion.mission.mission import Mission, MissionError
from companion.mission.stored_mission import mission_of
from companion.settings import Settings


class Stoppable(Protocol):
    """Something that a signal stops."""

    def stop(self) -> None:
        """Safe in a signal handler."""
        ...


class Stopper(Protocol):
    """Passes signals on to its listener."""

    listener: Stoppable | None


class Source:
    """Loads the mission and opens the link once. Raises MissionError unless either a file or the autopilot is given."""

    def __init__(
        self,
        mission_file: Path | None,
        connect: str,
        *,
        from_autopilot: bool,
        skip_unknown: bool = False,
        given: Given = NOTHING_GIVEN,
    ) -> None:
        if (mission_file is not None) == from_autopilot:
            how_many = "both were given" if from_autopilot else "neither was given"
            raise MissionError(f"run: give a MISSION file or --from-autopilot: {how_many}")
        self._file = mission_file
        self._given = given
        self._connect = connect
        self._skip_unknown = skip_unknown
        self._link: ByteLink | None = None

    def mission(
        self,
        settings: Settings,
        signer: Signer | None,
        stop: Stopper,
        say: Callable[[str], None],
        warn: Callable[[str], None],
    ) -> Mission | None:
        """The mission; None if a signal came during the download. ``warn`` is told of doubtful places.

        Raises MissionError, LinkError.
        """
        if self._file is not None:
            return self._looked_at(load_mission(self._file, simulated=False, skip_unknown=self._skip_unknown), warn)
        autopilot = AutopilotLink(self.link(), Codec(settings.link, signer=signer), settings.link)
        fetching = MissionFetcher(autopilot, WallClock(), settings.link.tick_hz)
        stop.listener, shown = fetching, ""

        def show(text: str) -> None:
            nonlocal shown
            if text != shown:
                shown = text
                say(text)

        try:
            items = fetching.fetch(show)
        finally:
            stop.listener = None
        return None if items is None else self._looked_at(mission_of(items, skip_unknown=self._skip_unknown), warn)

    def _looked_at(self, mission: Mission, warn: Callable[[str], None]) -> Mission:
        """The mission with what the command line says of it."""
        mission = with_given(mission, self._given)
        warn_of_places(mission, warn)
        return mission

    def link(self) -> ByteLink:
        """The link to the autopilot, opened at the first call. Raises LinkError."""
        if self._link is None:
            self._link = open_link(self._connect)
        return self._link


def refuse_arming(mission: Mission, *, arm: bool) -> Mission:
    """The mission, unless the autopilot drives it in AUTO and ``arm`` is given. Raises MissionError."""
    if mission.in_auto and arm:
        raise MissionError(
            f"{mission.source or mission.name}: the autopilot drives this mission in AUTO (NAV_GUIDED_ENABLE), "
            "so a person arms; leave out --arm"
        )
    return mission


def warn_of_places(mission: Mission, warn: Callable[[str], None]) -> None:
    """Say which targets are far from the file's own home or seem to be swapped, and that home is at the edge."""
    for line in (*doubtful_places(mission), *home_at_edge(mission)):
        warn(line)


def warning(line: str) -> str:
    """The line for people."""
    return f"warning: {line}"
