"""Campaign files: what is driven, as lists (axes) of which every combination is one run for each seed.

Nouns: campaign.
"""

from __future__ import annotations

import math
import re
from copy import deepcopy
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from companion.core.own_parts import OwnPartError
from companion.executive.controller_choice import check_controller
from companion.planning.registry import UnknownPlannerError, make_planner
from companion.settings import PlannerSettings, Settings, SettingsError
from companion.settings.settings import ControllerKind
from companion.settings.settings_file import parse_settings
from companion.storage.plain_words import plain
from companion.storage.toml_file import read_table
from sitl.autopilot.start_up import ARMABLE_S
from sitl.campaign.worded import NOTHING, OWN, GroundSpec, SensorSpec, faults_of
from sitl.faults.fault_file import FaultFileError
from sitl.generators.kinds import GroundKind

SHIPPED = "shipped"
"""The name of the settings without a change."""
Share = Annotated[float, Field(ge=0.0, le=0.9)]
Seconds = Annotated[float, Field(ge=0.0, le=2.0)]
MOST_RUNS = 1_000_000
SETS_OFF_S = ARMABLE_S + 2.0
"""No rover rolls earlier: it is armed after the start-up and sent off then (measured: 45.3 s at the earliest)."""
GREATEST_SEED = 2**53
"""Every program that reads a table has whole numbers as large as this."""


class CampaignError(Exception):
    """A campaign that cannot be driven; the text is one line with file, place and remedy."""


def _plain_name(name: str) -> str:
    if re.fullmatch(r"[\w .,+()-]*", name) is None:
        raise ValueError("it names a folder; use letters, digits, blanks and . , + ( ) - _ alone")
    return name


class SearchPart(StrEnum):
    """What a search may move."""

    WORLD = "world"
    TRAFFIC = "traffic"
    ROVER = "rover"
    SENSORS = "sensors"
    FAULTS = "faults"
    SETTINGS = "settings"


class SearchTable(BaseModel):
    """``[search]``: what ``--search`` moves.

    ``settings``: bounds of more settings than the tunable ones, or other bounds. ``faults_until_s``: when the last one
    may begin, from when the rover begins to drive. Things that move are not among what is moved without a word: a rover
    that moves among things that never yield is touched now and then.
    """

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    parts: list[Annotated[SearchPart, Field(strict=False)]] = Field(
        default=[one for one in SearchPart if one is not SearchPart.TRAFFIC], min_length=1
    )
    settings: dict[str, Annotated[tuple[float, float], Field(strict=False)]] = Field(default_factory=dict)
    faults_until_s: float = Field(default=60.0, ge=1.0, le=3600.0)


class CampaignTable(BaseModel):
    """The file. All lists are axes; the first value of each is what the others are compared with."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    name: Annotated[str, AfterValidator(_plain_name)] = Field(default="", max_length=100)
    worlds: list[str] = Field(min_length=1)
    seed: int = Field(default=0, ge=0, le=GREATEST_SEED)
    runs: int = Field(default=30, ge=1)
    planners: list[str] = Field(default=["hybrid"], min_length=1)
    controllers: list[ControllerKind] = Field(default=["points"], min_length=1)
    sensors: list[str] = Field(default=[OWN], min_length=1)
    faults: list[str] = Field(default=[NOTHING], min_length=1)
    guard: list[bool] = Field(default=[False], min_length=1)
    off_model: list[Share] = Field(default=[0.0], min_length=1)
    late_s: list[Seconds] = Field(default=[0.0], min_length=1)
    time_limit_s: float = Field(default=1800.0, gt=0.0, le=36000.0)
    person: bool = False
    autopilot_on_s: float = Field(default=0.0, ge=0.0, le=ARMABLE_S)
    settings: dict[str, dict[str, Any]] = Field(default={SHIPPED: {}}, min_length=1)
    search: SearchTable = SearchTable()


def load_campaign(path: Path) -> CampaignTable:
    """Read a campaign. Files that it names count from its own folder, and must be there.

    Raises CampaignError: one line with file, place, reason and remedy.
    """
    table = read_table(path, CampaignTable, CampaignError, "docs/campaigns.md describes the file")
    folder = path.resolve().parent
    _check_names(path, table)
    if table.time_limit_s <= SETS_OFF_S:
        raise CampaignError(
            f"{path}: time_limit_s: {table.time_limit_s:g} s end every run before its rover sets off (the autopilot's "
            f"start-up takes {ARMABLE_S:g} s); give more than {SETS_OFF_S:g}, enough to drive, or leave it out"
        )
    count = run_count(table)
    if count > MOST_RUNS:
        raise CampaignError(f"{path}: {count} runs are more than {MOST_RUNS}; make the lists shorter")
    for world in table.worlds:
        _check_world(path, folder, world)
    for number, plan in enumerate(table.faults, 1):
        _check_faults(path, folder, number, plan)
    for number, sensors in enumerate(table.sensors, 1):
        try:
            SensorSpec.of(sensors).check(folder)
        except ValueError as error:
            raise CampaignError(f"{path}: sensors {number}: {error}") from error
    _check_once(path, folder, table)
    return table.model_copy(update={"name": _name_of(path, table)})


def _name_of(path: Path, table: CampaignTable) -> str:
    """That of the folder of results, too. Raises CampaignError."""
    name = table.name or re.sub(r"[^\w .,+()-]", "-", path.stem)
    if not re.search(r"\w", name):
        raise CampaignError(f"{path}: name: {name!r} names no folder; give it letters or digits")
    return name


def run_count(table: CampaignTable) -> int:
    """How many runs there are."""
    lists = (
        table.worlds, table.planners, table.controllers, table.sensors, table.faults, table.guard, table.off_model,
        table.late_s, table.settings,
    )  # fmt: skip
    count = table.runs
    for values in lists:
        count *= len(values)
    return count


def _check_names(path: Path, table: CampaignTable) -> None:
    for number, name in enumerate(table.planners, 1):
        try:
            make_planner(name, PlannerSettings())
        except UnknownPlannerError as error:
            raise CampaignError(f"{path}: planners {number}: {error}") from error
    for number, name in enumerate(table.controllers, 1):
        try:
            check_controller(name)
        except OwnPartError as error:
            raise CampaignError(f"{path}: controllers {number}: {error}") from error
    for name, values in table.settings.items():
        try:
            parse_settings(deepcopy(values), f"{path}: settings.{name}")
        except SettingsError as error:
            raise CampaignError(str(error)) from error
        for section, key, axis in (("guidance", "controller", "controllers"), ("navigator", "planner", "planners")):
            if key in values.get(section, {}):
                raise CampaignError(
                    f"{path}: settings.{name}: {section}.{key}: stands in the list {axis}; name it there"
                )
    _check_search(path, table.search)


def _check_once(path: Path, folder: Path, table: CampaignTable) -> None:
    """No list has the same twice, in other words either: it would count twice. Raises CampaignError."""
    meanings: dict[str, list[Any]] = {
        "worlds": [GroundSpec.of(world) or (folder / world).resolve() for world in table.worlds],
        "sensors": [SensorSpec.of(sensors) for sensors in table.sensors],
        "faults": [plan if plan == NOTHING else replace(faults_of(plan, folder), source="") for plan in table.faults],
        **{axis: getattr(table, axis) for axis in ("planners", "controllers", "guard", "off_model", "late_s")},
        "settings": [*table.settings.values()],
    }
    for axis, values in meanings.items():
        if any(value in values[:number] for number, value in enumerate(values)):
            raise CampaignError(f"{path}: {axis}: a value stands there twice; each combination is driven once")


def _check_search(path: Path, search: SearchTable) -> None:
    """Its parts stand there once; its settings are moved, are numbers, and may have their bounds, which ascend.

    Raises CampaignError.
    """
    if len(set(search.parts)) < len(search.parts):
        raise CampaignError(f"{path}: search.parts: one stands there twice; name each once")
    if search.settings and SearchPart.SETTINGS not in search.parts:
        raise CampaignError(f'{path}: search.settings: moved only where "settings" stands in search.parts')
    if "faults_until_s" in search.model_fields_set and SearchPart.FAULTS not in search.parts:
        raise CampaignError(
            f'{path}: search.faults_until_s: means something only where "faults" stands in search.parts'
        )
    for name, (low, high) in search.settings.items():
        section, _, key = name.partition(".")
        usual = getattr(getattr(Settings(), section, None), key or "-", None)
        if isinstance(usual, bool) or not isinstance(usual, int | float):
            why = "is no number of docs/settings.md with a default that is one: a search moves no others"
            raise CampaignError(f"{path}: search.settings: {name!r:.60} {why}")
        if not low < high:
            raise CampaignError(f"{path}: search.settings: {name}: {low:g} is not less than {high:g}")
        for bound in (low, high):
            whole = isinstance(usual, int) and math.isfinite(bound)
            if fault := _fault_of_setting(section, key, int(bound) if whole else bound):
                raise CampaignError(f"{path}: search.settings: {name}: {fault}; docs/settings.md has its bounds")


def _fault_of_setting(section: str, key: str, value: float) -> str:
    """What is wrong with a value by itself; empty if nothing is. What it says with others a search finds out."""
    try:
        Settings.model_validate({section: {key: value}})
    except ValidationError as error:
        told = [plain(one) for one in error.errors() if one["loc"] == (section, key)]
        return f"{told[0]} (got {value:g})" if told else ""
    return ""


def _check_world(path: Path, folder: Path, world: str) -> None:
    """It must be a kind of ground or a mission. Raises CampaignError."""
    try:
        ground = GroundSpec.of(world)
    except ValueError as error:
        raise CampaignError(f"{path}: worlds: {world!r:.80}: {error}") from error
    if ground is None and not (folder / world).is_file():
        kinds = ", ".join(GroundKind)
        raise CampaignError(f"{path}: worlds: {world!r:.80} is no kind of ground ({kinds}) and no mission file")


def _check_faults(path: Path, folder: Path, number: int, plan: str) -> None:
    """It must be a plan that can be used. Raises CampaignError."""
    if plan != NOTHING:
        try:
            faults_of(plan, folder)
        except FaultFileError as error:
            raise CampaignError(f"{path}: faults {number}: {str(error).removeprefix('faults: ')}") from error
