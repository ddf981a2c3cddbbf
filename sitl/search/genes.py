"""What a search may move, each within bounds, and the run that values of these make.

Nouns: gene.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from annotated_types import Ge, Le

from companion.settings import Settings
from companion.settings.tunable_parameters import TABLE
from sitl.campaign.campaign_file import CampaignTable, SearchPart
from sitl.campaign.run_spec import RunSpec
from sitl.campaign.worded import BETWEEN_FAULTS, NOTHING, GroundSpec, SensorSpec, Worded
from sitl.generators.kinds import parameters_of

Values = Mapping[str, float]
"""By the names of genes; a gene without a value is as usual."""
DIGITS = 3
"""Values are rounded to so many, so that people can read what was found."""
DECADE = 10.0
"""Bounds farther apart than this factor are searched by their logarithm."""
MOST_MOVERS = 6
WORLD_FACTOR = 2.0
"""So far a parameter of the ground may be from the usual."""


@dataclass(frozen=True, slots=True)
class Gene:
    """One figure. ``usual``: what it is without a word."""

    part: SearchPart
    name: str
    low: float
    high: float
    usual: float
    whole: bool = False
    rarely: float = 0.0
    """Up to this share it is ``low``."""

    def value(self, share: float) -> float:
        """Of a share from 0 (``low``) to 1 (``high``)."""
        share = (min(max(share, self.rarely), 1.0) - self.rarely) / (1.0 - self.rarely)
        if self._by_logarithm:
            value = self.low * float((self.high / self.low) ** share)
        else:
            value = self.low + share * (self.high - self.low)
        if self.whole:
            return round(value)
        return min(max(float(f"{value:.{DIGITS}g}"), self.low), self.high)

    def share(self, value: float) -> float:
        """The reverse of ``value``."""
        value = min(max(value, self.low), self.high)
        if value == self.low:
            return 0.0
        if self._by_logarithm:
            share = math.log(value / self.low) / math.log(self.high / self.low)
        else:
            share = (value - self.low) / (self.high - self.low)
        return self.rarely + (1.0 - self.rarely) * share

    @property
    def _by_logarithm(self) -> bool:
        return self.low > 0.0 and self.high > DECADE * self.low


ROVER = (Gene(SearchPart.ROVER, "off_model", 0.0, 0.3, 0.0), Gene(SearchPart.ROVER, "late_s", 0.0, 0.2, 0.0))
"""As far off its model and as late as the rover must bear (docs/planned-motions.md)."""
SENSORS = (
    Gene(SearchPart.SENSORS, "noise_m", 0.0, 0.1, 0.02),
    Gene(SearchPart.SENSORS, "dropout", 0.0, 0.3, 0.0),
    Gene(SearchPart.SENSORS, "false_echo", 0.0, 0.005, 0.0),
    Gene(SearchPart.SENSORS, "latency_s", 0.0, 0.2, 0.0),
    Gene(SearchPart.SENSORS, "max_m", 3.0, 12.0, 8.0),
)
RARELY = 0.5
"""Up to this share a fault does not happen: with all kinds at once no run would show anything."""


@dataclass(frozen=True, slots=True)
class MovedFault:
    """A kind of fault with the bounds of its keys.

    ``harm``: the key without which there is none. ``fixed``: further words of docs/faults.md.
    """

    harm: str
    bounds: Mapping[str, tuple[float, float]]
    fixed: Mapping[str, Any] = field(default_factory=dict)


FAULTS = {
    "link_outage": MovedFault("duration_s", {"duration_s": (0.1, 10.0)}),
    "packet_loss": MovedFault("probability", {"duration_s": (1.0, 30.0), "probability": (0.02, 0.3)}),
    "packet_delay": MovedFault("delay_s", {"duration_s": (1.0, 30.0), "delay_s": (0.02, 1.0), "jitter_s": (0.0, 0.5)}),
    "packet_reorder": MovedFault("probability", {"duration_s": (1.0, 30.0), "probability": (0.02, 0.3)}),
    "packet_duplicate": MovedFault("probability", {"duration_s": (1.0, 30.0), "probability": (0.02, 1.0)}),
    "packet_corrupt": MovedFault("probability", {"duration_s": (1.0, 30.0), "probability": (0.02, 0.3)}),
    "autopilot_reboot": MovedFault("duration_s", {"duration_s": (0.5, 5.0)}),
    "pilot": MovedFault("duration_s", {"duration_s": (0.2, 20.0)}, {"mode": "HOLD"}),
    "gps_loss": MovedFault("duration_s", {"duration_s": (0.5, 15.0)}),
    "gps_glitch": MovedFault("metres", {"duration_s": (0.5, 15.0), "metres": (0.2, 20.0), "bearing_deg": (0.0, 360.0)}),
    "gps_noise": MovedFault("metres", {"duration_s": (1.0, 30.0), "metres": (0.02, 0.25)}),
    "gps_fix": MovedFault(
        "metres",
        {"duration_s": (1.0, 30.0), "metres": (0.05, 1.5), "bearing_deg": (0.0, 360.0)},
        {"fix": "rtk-float"},
    ),
    "sensor_silent": MovedFault("duration_s", {"duration_s": (0.1, 10.0)}),
    "sensor_stuck": MovedFault("duration_s", {"duration_s": (0.1, 10.0)}, {"in_view": True}),
    "wheel_slip": MovedFault("share", {"duration_s": (0.5, 10.0), "share": (0.05, 0.6)}),
    "battery_low": MovedFault("volts", {"duration_s": (1.0, 30.0), "volts": (9.0, 12.0)}),
}
"""The others need what a campaign's runs do not have: lidars on serial lines, commands, a gate for the GPS fix."""
SETTINGS = {"guidance.look_ahead_m": (0.3, 2.0), "guidance.overshoot_m": (0.05, 1.0)}
"""Beside those that a ground station may change: docs/settings.md gives them no upper bounds."""


def genes_of(campaign: CampaignTable, base: RunSpec) -> tuple[Gene, ...]:
    """All that a search on this run may move: of the parts that the campaign's ``[search]`` names."""
    groups = {
        SearchPart.WORLD: _of_ground(base.world),
        SearchPart.TRAFFIC: _of_traffic(base.world),
        SearchPart.ROVER: tuple(replace(gene, usual=getattr(base, gene.name)) for gene in ROVER),
        SearchPart.SENSORS: _of_sensors(base.sensors),
        SearchPart.FAULTS: _of_faults(campaign.search.faults_until_s),
        SearchPart.SETTINGS: _of_settings(campaign, base),
    }
    return tuple(gene for part in campaign.search.parts for gene in groups[part])


def spec_with(base: RunSpec, genes: Sequence[Gene], values: Values) -> RunSpec:
    """The run with these values of genes; those that have none are as in ``base``."""
    of = {part: {gene.name: values[gene.name] for gene in genes if gene.part == part and gene.name in values}
          for part in SearchPart}  # fmt: skip
    changes = json.loads(base.changes)
    for name, value in of[SearchPart.SETTINGS].items():
        section, _, key = name.partition(".")
        changes.setdefault(section, {})[key] = value
    faults = _faults_in_words(base.faults, of[SearchPart.FAULTS])
    return replace(
        base,
        world=_more(base.world, {**of[SearchPart.WORLD], **of[SearchPart.TRAFFIC]}),
        sensors=_more(base.sensors, of[SearchPart.SENSORS]),
        faults=faults,
        off_model=of[SearchPart.ROVER].get("off_model", base.off_model),
        late_s=of[SearchPart.ROVER].get("late_s", base.late_s),
        changes=json.dumps(changes, sort_keys=True),
        settings="found" if of[SearchPart.SETTINGS] else base.settings,
    )


def _of_ground(world: str) -> tuple[Gene, ...]:
    ground = GroundSpec.of(world)
    if ground is None:
        return ()
    genes = []
    for name, one in parameters_of(ground.kind).model_fields.items():
        lows = [float(bound.ge) for bound in one.metadata if isinstance(bound, Ge)]  # type: ignore[arg-type]
        highs = [float(bound.le) for bound in one.metadata if isinstance(bound, Le)]  # type: ignore[arg-type]
        if not lows or not highs:
            continue  # one's own, without bounds
        low, high = lows[0], highs[0]
        usual = float(getattr(ground.given, name))
        if usual > 0.0:  # far from the usual most grounds have no way
            low, high = max(low, usual / WORLD_FACTOR), min(high, usual * WORLD_FACTOR)
        genes.append(Gene(SearchPart.WORLD, name, low, high, usual, whole=one.annotation is int))
    return tuple(genes)


def _of_traffic(world: str) -> tuple[Gene, ...]:
    ground = GroundSpec.of(world)
    return () if ground is None else (Gene(SearchPart.TRAFFIC, "movers", 0, MOST_MOVERS, ground.movers, whole=True),)


def _of_sensors(sensors: str) -> tuple[Gene, ...]:
    given = SensorSpec.of(sensors).changes.model_dump(exclude_none=True)
    return tuple(replace(gene, usual=given.get(gene.name, gene.usual)) for gene in SENSORS)


def _of_faults(until_s: float) -> tuple[Gene, ...]:
    """They begin from when the rover begins to drive until ``until_s`` later."""
    return tuple(
        Gene(SearchPart.FAULTS, f"{kind}.{key}", low, high, low, rarely=RARELY if key == one.harm else 0.0)
        for kind, one in FAULTS.items()
        for key, (low, high) in {"start_s": (0.0, until_s), **one.bounds}.items()
    )


def _of_settings(campaign: CampaignTable, base: RunSpec) -> tuple[Gene, ...]:
    """Those that ground stations may change, within their bounds, ``SETTINGS``, and the campaign's own."""
    settings, changes = Settings(), json.loads(base.changes)
    bounds = {f"{one.section}.{one.key}": (one.low, one.high, one.whole) for one in TABLE}
    for name, (low, high) in {**SETTINGS, **campaign.search.settings}.items():
        bounds[name] = (low, high, isinstance(_setting(settings, name), int))
    genes = []
    for name, (low, high, whole) in bounds.items():
        section, _, key = name.partition(".")
        usual = float(changes.get(section, {}).get(key, _setting(settings, name)))
        genes.append(Gene(SearchPart.SETTINGS, name, low, high, usual, whole))
    return tuple(genes)


def _setting(settings: Settings, name: str) -> Any:
    section, _, key = name.partition(".")
    return getattr(getattr(settings, section), key)


def _more(text: str, values: Values) -> str:
    name, there = Worded.of(text)
    return str(Worded(name, {**there, **values}))


def _faults_in_words(base: str, values: Values) -> str:
    pieces = [] if base == NOTHING else [base]
    for kind, one in FAULTS.items():
        if f"{kind}.{one.harm}" in values:
            lows = {"start_s": 0.0, **{key: low for key, (low, _) in one.bounds.items()}}
            given = {key: values.get(f"{kind}.{key}", low) for key, low in lows.items()}
            pieces.append(str(Worded(kind, {**given, **one.fixed, "since": "driving"})))
    return f"{BETWEEN_FAULTS} ".join(pieces) or NOTHING
