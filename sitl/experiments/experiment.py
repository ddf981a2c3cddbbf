"""What every experiment takes and gives, and the maps they share."""

from __future__ import annotations

import hashlib
import os
import platform
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from importlib.resources import files
from itertools import starmap
from os import cpu_count
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Protocol, TypeVar, runtime_checkable

from rich.table import Table

from companion.core.extras import not_installed
from companion.core.grid import Cell, Grid
from companion.core.own_parts import OwnKind, OwnPartError, looks_own
from companion.executive.controller_choice import check_controller
from companion.mapping.map_files import load_map
from companion.planning.registry import UnknownPlannerError, make_planner
from companion.settings import PlannerSettings
from companion.settings.settings import CONTROLLERS, ControllerKind
from companion.storage.files import why_no_file
from companion.storage.shipped import SOURCE, shipped
from companion.storage.validation import alike
from sitl.experiments import drawing
from sitl.experiments.results_page import write_section
from sitl.worker_end import apart

if TYPE_CHECKING:
    from matplotlib.figure import Figure

POINTS: ControllerKind = "points"
GUARD = {"SCR_ENABLE": 1.0, "SCR_USER1": 300.0}
"""The guard on the autopilot puts HOLD so many milliseconds after the companion's last packet."""
TIMEOUT_S = 3.0
"""GUID_TIMEOUT as ArduRover is shipped; older firmware has it fixed."""
OFF_MODEL = 0.3
"""So far a rover is off what the companion takes it for, at most, unless it is said."""
START, TARGET = Cell(0, 24), Cell(98, 24)
"""Section 5 of Kwasniewski & Gosiewski 2018; all maps are 100 x 50 fields."""


class ExperimentError(Exception):
    """An experiment that cannot be made; the text is one line with place and remedy."""


@dataclass(frozen=True, slots=True)
class Options:
    """How much of an experiment to do. Run i has the seed ``seed + i``; ``maps`` None: those of the source checkout.

    ``worlds``: maps of the user's, with scenario files beside them, and ``planners``, names (none: the experiment's own
    choice), for experiments that take any.
    """

    runs: int = 100
    seed: int = 0
    jobs: int = 1
    maps: Path | None = None
    worlds: tuple[Path, ...] = ()
    planners: tuple[str, ...] = ()
    archive: Path | None = None
    """``barn``: a file of worlds; None: worlds of our own making."""
    controllers: tuple[str, ...] = ()
    """What leads the rover, for experiments that take any; none: the experiment's own choice."""
    setups: tuple[str, ...] = ()
    """``barn``: what is driven; none: the experiment's own choice."""
    lidar: str | None = None
    """``barn``: the model of the lidar that the companion reads itself; None: distances come over MAVLink."""
    guard: bool = False
    """The autopilot has the guard, for experiments in which that is to be chosen."""
    off: float = OFF_MODEL
    """So far the rover is off its model, at most: a share."""
    late_s: float = 0.0
    """So long each message takes over the link, each way."""
    timeout_s: float = TIMEOUT_S
    """The autopilot's GUID_TIMEOUT: so long the last velocity goes on."""
    keep: Path | None = None
    """The folder in which the results of single runs are kept; None: nowhere."""
    missions: tuple[str, ...] = ()
    """Which of those that ship with the project; none: all."""
    sensors: tuple[str, ...] = ()
    """``missions``: with which suites of sensors; none: all three."""
    outline_m: tuple[float, float] | None = None
    """``gates``: length and width of the rover; None: the experiment's own."""
    turning_radius_m: float = 0.0
    """``driving``: of a rover with steered wheels, on generated ground alone; 0: the experiment's own rovers."""

    def command(self, name: str) -> str:
        """What writes this experiment's part of the results page again."""
        chosen = f" --planners {','.join(self.planners)}" if self.planners else ""
        chosen += f" --controllers {','.join(self.controllers)}" if self.controllers else ""
        chosen += f" --missions {','.join(self.missions)}" if self.missions else ""
        chosen += f" --sensors {','.join(self.sensors)}" if self.sensors else ""
        chosen += f" --setups {','.join(self.setups)}" if self.setups else ""
        chosen += f" --lidar {self.lidar}" if self.lidar else ""
        chosen += " --guard" if self.guard else ""
        chosen += "" if self.off == OFF_MODEL else f" --off {self.off:g}"
        chosen += f" --late {self.late_s:g}" if self.late_s else ""
        chosen += "" if self.timeout_s == TIMEOUT_S else f" --guid-timeout {self.timeout_s:g}"
        chosen += "" if self.outline_m is None else f" --outline {'x'.join(f'{one:g}' for one in self.outline_m)}"
        chosen += f" --turning-radius {self.turning_radius_m:g}" if self.turning_radius_m else ""
        chosen += f" --worlds {self.archive.name}" if self.archive else ""
        chosen += f" --maps {self.maps.name}" if self.maps else ""
        return f"rover-sitl experiment {name} --runs {self.runs} --seed {self.seed}{chosen} --docs docs"

    @property
    def usual(self) -> bool:
        """Whether the rover is as far off its model as usual, over a link without delay."""
        return self.off == OFF_MODEL and self.late_s == 0.0

    @property
    def timeout_suffix(self) -> str:
        """Of the name of a section, where the timeout is another one than usual."""
        return "" if self.timeout_s == TIMEOUT_S else f"-guid-timeout-{self.timeout_s:g}"

    @property
    def timeout_title(self) -> str:
        """Of the title of a section, where the timeout is another one than usual."""
        return "" if self.timeout_s == TIMEOUT_S else f", a timeout of {self.timeout_s:g} s"

    @property
    def mismatch(self) -> str:
        """What is not as the companion expects it, in words."""
        late = f", and each message takes {self.late_s:g} s over the link, each way" if self.late_s else ""
        ends = "" if self.timeout_s == TIMEOUT_S else f"; the autopilot ends a velocity after {self.timeout_s:g} s"
        return f"off by up to {100.0 * self.off:.0f} % from what the companion takes them for{late}{ends}"


def unknown(option: str, name: str, known: Iterable[str], more: str = "") -> ExperimentError:
    """The error for a name of a list that nobody knows. ``more``: said after those that are known."""
    near = alike(name, known := tuple(map(str, known)))
    hint = f", did you mean {near!r}?" if near else ";"
    return ExperimentError(f"{option}: {name!r:.60} is unknown{hint} known: {', '.join(known)}{more}")


def chosen_controllers(options: Options, otherwise: tuple[ControllerKind, ...]) -> tuple[ControllerKind, ...]:
    """The controllers that were asked for, or others. Raises ExperimentError for one that does not exist."""
    for name in options.controllers:
        if name not in CONTROLLERS and not looks_own(OwnKind.CONTROLLER, name):
            raise unknown("--controllers", name, CONTROLLERS, ", and module:name")
        try:
            check_controller(name)
        except OwnPartError as error:
            raise ExperimentError(f"--controllers: {error}") from error
    asked = dict.fromkeys(options.controllers)
    own = (name for name in asked if name not in CONTROLLERS)
    return (*(name for name in CONTROLLERS if name in asked), *own) or otherwise


class ExperimentReport(ABC):
    """What came out: the base class of every experiment's report."""

    name: ClassVar[str]
    page: ClassVar[str] = "results.md"
    """The page of the documentation that has its section."""

    @property
    def section_name(self) -> str:
        """Of its section there. One with another rover or link than usual stands beside the usual one."""
        options: Options | None = getattr(self, "options", None)
        if options is None:
            return self.name
        return self.name + ("" if options.usual else "-off-model") + options.timeout_suffix

    @abstractmethod
    def tables(self) -> list[Table]:
        """For the terminal."""

    @abstractmethod
    def as_json(self) -> dict[str, object]:
        """Everything measured."""

    @abstractmethod
    def section(self) -> str:
        """Its section of the page, in Markdown."""

    def pictures(self) -> dict[str, Figure]:
        """Pictures of the section, by name without suffix."""
        return {}

    def write_docs(self, folder: Path) -> list[Path]:
        """Write pictures (under images/) and section; gives the files written."""
        files = [drawing.save(picture, folder / "images" / f"{name}.png") for name, picture in self.pictures().items()]
        return [*files, write_section(folder, self.section_name, self.section(), self.page)]


def section_by_rule(name: str, guard: bool, planned: int) -> str:
    """The section's name of an experiment of which the results page has three: with points, guarded, and strict.

    ``planned``: how many of its results are of planned motions.
    """
    if guard:
        return f"{name}-guarded"
    return f"{name}-strict" if planned else name


@runtime_checkable
class Checked(Protocol):
    """A report of something that may not happen."""

    @property
    def failure(self) -> str:
        """What happened all the same, in words; empty for nothing."""
        ...


Advance = Callable[[int, int], None]
"""Called with the runs done and the runs there are."""

Experiment = Callable[[Options, Advance], ExperimentReport]


Result = TypeVar("Result")


def each(
    jobs: int, work: Callable[..., Result], tasks: Iterable[tuple[object, ...]], keep: Path | None = None
) -> Iterator[Result]:
    """The results of ``work`` for each tuple of arguments, in their order, made by ``jobs`` processes.

    ``keep``: a folder in which each result is kept; one that is there is not made again.
    Raises ExperimentError if joblib is needed and not installed.
    """
    if jobs == 1 and keep is None:
        return starmap(work, tasks)
    try:
        from joblib import Memory, Parallel, delayed
    except ImportError as error:
        option = f"--jobs {jobs}" if keep is None else f"--keep {keep}"
        raise ExperimentError(not_installed(option, "experiments", "joblib")) from error
    do = work if keep is None else Memory(keep / code_digest(), verbose=0).cache(work)
    parent = os.getpid()
    made: Iterator[Result] = Parallel(n_jobs=jobs, return_as="generator")(
        delayed(apart)(parent, do, *task) for task in tasks
    )
    return made


@cache
def code_digest() -> str:
    """A name for the code as it stands: results that other code made are not taken for its own.

    Once a process: what is written on the disk later is not what it runs.
    """
    digest = hashlib.sha256()
    for package in ("companion", "sitl"):
        folder = Path(str(files(package)))
        for file in sorted(folder.rglob("*.py")):
            digest.update(file.relative_to(folder).as_posix().encode() + file.read_bytes())
    return digest.hexdigest()[:16]


def planners_of(options: Options, usual: Iterable[str]) -> tuple[str, ...]:
    """The planners to compare. Raises ExperimentError for an unknown name."""
    for name in options.planners:
        try:
            make_planner(name, PlannerSettings())
        except UnknownPlannerError as error:
            raise ExperimentError(f"--planners: {error}") from error
    return tuple(dict.fromkeys(options.planners or usual))


def load_maps(folder: Path | None, names: tuple[str, ...]) -> dict[str, Grid]:
    """The named maps (NAME.png). Raises ExperimentError, or MapError for a file that is no map."""
    given = (shipped() or SOURCE) / "maps" if folder is None else folder
    if not given.is_dir():
        raise ExperimentError(f"{given}: no such folder of maps; name one with --maps (missions/maps of the source)")
    maps = {}
    for name in names:
        file = given / f"{name}.png"
        if fault := why_no_file(file):
            raise ExperimentError(f"{file}: {fault}; this experiment needs {', '.join(names)} (.png) in --maps")
        grid = load_map(file)
        for what, cell in (("start", START), ("target", TARGET)):
            if grid.is_obstacle(cell):
                raise ExperimentError(f"{file}: the {what} {tuple(cell)} is outside the map or an obstacle")
        maps[name] = grid
    return maps


def shipped_missions(maps: Path | None, names: tuple[str, ...]) -> list[Path]:
    """The files of the missions that ship with the project: they lie beside the folder of maps.

    Raises ExperimentError.
    """
    source = (shipped() or SOURCE) / "maps"
    folder = source if maps is None else maps
    if maps is not None and not maps.is_dir():
        raise ExperimentError(f"{maps}: no such folder of maps; name one with --maps (missions/maps of the source)")
    files = [folder.resolve().parent / name for name in names]
    for file in files:
        if not file.is_file():
            says = f"{folder}: {file.name} does not lie beside this folder"
            raise ExperimentError(f"{says}; this experiment needs missions/maps of the source in --maps")
    return files


def where_measured() -> str:
    """The computer and the versions that times depend on, in words."""
    return (
        f"{platform.machine()}, {cpu_count()} processors, Python {platform.python_version()}, "
        f"rover-companion {version('rover-companion')}, numpy {version('numpy')}, numba {version('numba')}"
    )
