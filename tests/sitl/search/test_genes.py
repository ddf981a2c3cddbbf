"""What a search may move: bounds, rounding, and the run that values make."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.settings import Settings
from companion.settings.tunable_parameters import TABLE
from sitl.campaign.campaign_file import CampaignTable, SearchPart, SearchTable, load_campaign
from sitl.campaign.drive_run import settings_of
from sitl.campaign.run_spec import RunSpec, specs_of
from sitl.campaign.worded import GroundSpec, SensorSpec, faults_of
from sitl.faults.tables import KINDS
from sitl.search.genes import FAULTS, RARELY, ROVER, SENSORS, SETTINGS, Gene, genes_of, spec_with

CAMPAIGN = CampaignTable(
    worlds=["cylinders movers=1"],
    runs=1,
    search=SearchTable(
        parts=["world", "traffic", "rover", "sensors", "faults", "settings"],
        settings={"guidance.look_ahead_m": (0.3, 2.0), "navigator.better_every_fields": (2, 9)},
    ),
)


def base() -> RunSpec:
    return next(specs_of(CAMPAIGN))


@given(st.sampled_from([*ROVER, *SENSORS, *genes_of(CAMPAIGN, base())]), st.floats(-1.0, 2.0))
def test_whatever_the_share_the_value_is_within_the_bounds(gene: Gene, share: float) -> None:
    value = gene.value(share)
    assert gene.low <= value <= gene.high
    assert not gene.whole or value == round(value)
    assert gene.value(gene.share(value)) == pytest.approx(value, rel=0.01, abs=0.5 if gene.whole else 1e-9)


def test_every_tunable_setting_may_move_within_its_bounds_and_the_campaigns_own_too() -> None:
    genes = {gene.name: gene for gene in genes_of(CAMPAIGN, base()) if gene.part == SearchPart.SETTINGS}
    assert {f"{one.section}.{one.key}" for one in TABLE} | {*SETTINGS} == set(genes)
    assert (genes["guidance.look_ahead_m"].low, genes["guidance.look_ahead_m"].high) == (0.3, 2.0)
    assert (genes["navigator.better_every_fields"].low, genes["navigator.better_every_fields"].whole) == (2, True)
    assert genes["guidance.clearance_m"].usual == Settings().guidance.clearance_m


def test_values_make_a_run_that_says_them_in_words() -> None:
    genes = genes_of(CAMPAIGN, base())
    values = {
        "filled": 0.2, "movers": 3, "off_model": 0.25, "late_s": 0.1, "dropout": 0.05, "max_m": 5.0,
        "wheel_slip.share": 0.3, "wheel_slip.start_s": 12.0, "guidance.clearance_m": 0.05,
    }  # fmt: skip
    spec = spec_with(base(), genes, values)
    ground = GroundSpec.of(spec.world)
    assert ground is not None and (ground.movers, ground.given.model_dump()["filled"]) == (3, 0.2)
    assert SensorSpec.of(spec.sensors).changes.model_dump(exclude_none=True) == {"dropout": 0.05, "max_m": 5.0}
    (slip,) = faults_of(spec.faults, None).faults  # type: ignore[arg-type]
    assert (slip.start_s, slip.end_s, slip.since) == (12.0, 12.5, "driving")
    assert (spec.off_model, spec.late_s) == (0.25, 0.1)
    assert json.loads(spec.changes) == {"guidance": {"clearance_m": 0.05}}
    assert settings_of(spec).guidance.clearance_m == 0.05
    assert spec_with(base(), genes, {}) == base(), "as usual: the same run"


def test_what_the_campaign_says_is_the_usual() -> None:
    table = CAMPAIGN.model_copy(update={"off_model": [0.3], "sensors": ["lidar-360 dropout=0.1"]})
    genes = {gene.name: gene for gene in genes_of(table, next(specs_of(table)))}
    assert (genes["off_model"].usual, genes["late_s"].usual, genes["dropout"].usual) == (0.3, 0.0, 0.1)


def test_a_fault_without_what_makes_it_one_is_none() -> None:
    assert spec_with(base(), genes_of(CAMPAIGN, base()), {"wheel_slip.start_s": 12.0}).faults == "none"


NEEDS_MORE = {"lidar_loss", "lidar_corrupt", "lidar_noise", "lidar_stalled", "lidar_unplugged", "command",
              "gps_fix_untold"}  # fmt: skip
"""Kinds that need what a campaign's runs do not have."""


@pytest.mark.parametrize("share", [0.51, 0.7, 1.0])
def test_every_kind_of_fault_is_moved_that_a_campaigns_runs_can_have(share: float) -> None:
    genes = [gene for gene in genes_of(CAMPAIGN, base()) if gene.part == SearchPart.FAULTS]
    spec = spec_with(base(), genes, {gene.name: gene.value(share) for gene in genes})
    plan = faults_of(spec.faults, None)  # type: ignore[arg-type]
    assert {*FAULTS} == {*KINDS} - NEEDS_MORE and len(plan.faults) == len(FAULTS) == 16
    assert all(fault.since == "driving" and fault.start_s <= 60.0 for fault in plan.faults)


def test_faults_begin_as_late_as_the_campaign_says() -> None:
    table = CAMPAIGN.model_copy(update={"search": SearchTable(parts=["faults"], faults_until_s=20.0)})
    begins = [gene for gene in genes_of(table, base()) if gene.name.endswith(".start_s")]
    assert len(begins) == len(FAULTS) and {(gene.low, gene.high) for gene in begins} == {(0.0, 20.0)}


def test_a_sensor_may_be_silent_for_longer_than_a_rover_needs_to_stand() -> None:
    assert FAULTS["sensor_silent"].bounds["duration_s"][1] >= 2.0 * 2.9


def test_up_to_half_of_its_share_a_fault_does_not_happen() -> None:
    """Else all kinds would befall every run."""
    genes = {gene.name: gene for gene in genes_of(CAMPAIGN, base()) if gene.part == SearchPart.FAULTS}
    for kind, one in FAULTS.items():
        harm = genes[f"{kind}.{one.harm}"]
        assert harm.value(0.0) == harm.value(RARELY) == harm.usual < harm.value(0.6) < harm.value(1.0) == harm.high


def test_what_was_found_once_is_within_what_a_search_can_reach() -> None:
    found = load_campaign(Path(__file__).parents[3] / "missions" / "campaigns" / "found" / "settings-together.toml")
    table = CampaignTable(worlds=["cylinders"])
    genes = {gene.name: gene for gene in genes_of(table, next(specs_of(table)))}
    reached = {f"guidance.{key}": value for key, value in found.settings["found"]["guidance"].items()}
    reached["filled"] = 0.15
    for name, value in reached.items():
        gene = genes[name]
        assert gene.low <= value <= gene.high and gene.value(gene.share(value)) == pytest.approx(value, rel=0.01), name
    values = {name: genes[name].value(genes[name].share(value)) for name, value in reached.items()}
    spec = spec_with(next(specs_of(table)), tuple(genes.values()), values)
    assert settings_of(spec).guidance.overshoot_m == 0.1
