"""States of runs that never were."""

from __future__ import annotations

import hashlib
import json
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

from companion.checkpoint.state_directory import StateDirectory
from companion.checkpoint.state_format import (
    LENGTH,
    MAGIC,
    VERSION,
    MapPart,
    Raster,
    SavedGenerator,
    SavedGrid,
    SavedNavState,
    SavedPlace,
    SavedProgress,
    SavedState,
    SavedTally,
    compressed_part,
    encode_state,
)
from companion.executive.mission_progress import MissionPhase, TargetStatus
from companion.mission.identity import fingerprint
from companion.mission.mission import Mission
from companion.safety.mode_latch import Control
from companion.storage.files import OsDisk, replace_file

FIELD = st.integers(-1000, 1000)
METRES = st.floats(-1e6, 1e6)


@st.composite
def progresses(draw: st.DrawFn) -> SavedProgress:
    statuses = draw(st.lists(st.sampled_from(TargetStatus), min_size=1, max_size=5))
    return SavedProgress(
        start=SavedPlace(north_m=draw(METRES), east_m=draw(METRES)),
        statuses=tuple(statuses),
        index=draw(st.integers(0, len(statuses) - 1)),
        phase=draw(st.sampled_from(MissionPhase)),
        left_s=draw(st.floats(0.0, 1e4)),
        give_up_left_s=draw(st.none() | st.floats(0.0, 1e4)),
    )


@st.composite
def states(draw: st.DrawFn) -> SavedState:
    count = st.integers(0, 2**60)
    word = st.integers(0, 2**128 - 1)
    nav_state = st.builds(
        SavedNavState,
        past=st.lists(st.tuples(FIELD, FIELD), min_size=1, max_size=30).map(tuple),
        returning=st.booleans(),
        until_search=st.integers(-3, 3),
        since_better=st.integers(0, 9),
        draws=st.integers(0, 2**64 - 1),
        doubts_left=st.integers(0, 3),
    )
    draws = st.builds(
        SavedGenerator, state=word, inc=word, has_uint32=st.integers(0, 1), uinteger=st.integers(0, 2**32 - 1)
    )
    return SavedState(
        mission=draw(st.text(max_size=20)),
        mission_sha256=hashlib.sha256(draw(st.binary(max_size=4))).hexdigest(),
        ended=draw(st.booleans()),
        control=draw(st.sampled_from(Control)),
        released=draw(st.booleans()),
        armed=draw(st.booleans()),
        boot_s=draw(st.floats(0.0, 1e6)),
        ahead_s=draw(st.floats(-1e6, 1e6)),
        origin=(draw(st.floats(-90.0, 90.0)), draw(st.floats(-180.0, 180.0))),
        home=(draw(st.floats(-90.0, 90.0)), draw(st.floats(-180.0, 180.0))),
        progress=draw(progresses()),
        nav_state=draw(st.none() | nav_state),
        trail=draw(st.lists(st.tuples(FIELD, FIELD), max_size=30).map(tuple)),
        ground=SavedGrid(
            north_m=draw(METRES),
            east_m=draw(METRES),
            resolution_m=0.5,
            width=7,
            height=5,
            subdivisions=draw(st.integers(1, 4)),
        ),
        tally=draw(st.builds(SavedTally, steps=count, return_steps=count, stuck=count, epoch=count)),
        draws=draw(st.none() | draws),
    )


def rasters_of(state: SavedState, seed: int) -> dict[str, Raster]:
    ground, rng = state.ground, np.random.default_rng(seed)
    fine = (ground.height * ground.subdivisions, ground.width * ground.subdivisions)
    log_odds = rng.choice(np.array([0.0, -1.2, 0.9, 3.0], np.float32), fine)
    return {"log_odds": log_odds, "penalty": rng.random((ground.height, ground.width)).astype(np.float32)}


def parts_of(rasters: dict[str, Raster], step: int) -> dict[MapPart, bytes]:
    parts = {}
    for name, raster in rasters.items():
        for row in range(0, len(raster), step):
            rows = raster[row : row + step]
            parts[MapPart(name, row, len(rows), 0, raster.shape[1])] = compressed_part(rows)
    return parts


def sealed(body: bytes) -> bytes:
    """With a checksum that is right."""
    return body + hashlib.sha256(body).digest()


def forged(head: Any, parts: bytes = b"") -> bytes:
    """A file with any head at all, and a right checksum."""
    packed = zlib.compress(json.dumps(head).encode())
    return sealed(MAGIC + b"%d\n" % VERSION + LENGTH.pack(len(packed)) + packed + parts)


def a_state(**changes: Any) -> SavedState:
    """One that could have been."""
    values: dict[str, Any] = {
        "mission": "Yard",
        "mission_sha256": "0" * 64,
        "ended": False,
        "control": Control.COMPANION,
        "released": False,
        "armed": True,
        "boot_s": 60.0,
        "ahead_s": 0.1,
        "origin": (53.1, 23.1),
        "home": (53.1, 23.1),
        "progress": SavedProgress(
            start=SavedPlace(north_m=0.0, east_m=0.0),
            statuses=(TargetStatus.PENDING,),
            index=0,
            phase=MissionPhase.TRAVEL,
            left_s=0.0,
            give_up_left_s=None,
        ),
        "nav_state": SavedNavState(
            past=((1, 2),), returning=False, until_search=0, since_better=0, draws=1, doubts_left=3
        ),
        "ground": SavedGrid(north_m=0.0, east_m=0.0, resolution_m=1.0, width=7, height=5, subdivisions=2),
        "tally": SavedTally(),
        "draws": None,
    }
    return SavedState(**{**values, **changes})


def leave_state(folder: Path, mission: Mission, **changes: object) -> StateDirectory:
    """A state of the mission, as a run has left it."""
    place = StateDirectory(folder / "state")
    state = a_state(**{"mission_sha256": fingerprint(mission), **changes})
    replace_file(OsDisk(), place.file, encode_state(state, {}))
    return place
