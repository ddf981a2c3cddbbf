"""Where the time went in a campaign, for each combination by itself."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg

from sitl.campaign.campaign_file import CampaignTable, load_campaign
from sitl.campaign.heat_maps import heat_maps, shown_seeds
from sitl.campaign.pictures import times
from sitl.campaign.run_spec import specs_of
from sitl.generators.made_ground import made
from tests.sitl.campaign.test_run_store import RESULT

MISSION = Path(__file__).resolve().parents[3] / "missions" / "open.toml"


def test_each_combination_has_its_own_heat_map_in_the_same_colours(tmp_path: Path) -> None:
    shutil.copy(MISSION, tmp_path)
    file = tmp_path / "c.toml"
    file.write_text('worlds = ["open.toml"]\nruns = 2\ncontrollers = ["points", "motion-ga"]\n')
    table = load_campaign(file)
    seconds = {"points": 8.0, "motion-ga": 2.0}
    runs = [(spec, replace(RESULT, dwelt=((3, 4, seconds[spec.controller]),))) for spec in specs_of(table)]
    ((world, figure),) = heat_maps(table, runs, tmp_path)
    assert world == "open: mean over the runs"
    panels = [panel for panel in figure.axes if panel.images]
    assert [panel.get_title(loc="left") for panel in panels] == ["points: 2 runs", "motion-ga: 2 runs"]
    shown = [panel.images[-1] for panel in panels]
    assert [float(image.get_array().max()) for image in shown] == [8.0, 2.0]
    assert {image.get_clim() for image in shown} == {(0.0, 8.0)}


def test_of_generated_ground_the_middle_one_and_the_slowest_are_drawn_with_what_stands_there(tmp_path: Path) -> None:
    """Another ground for each seed: a mean over them would show no place."""
    file = tmp_path / "c.toml"
    file.write_text('worlds = ["rooms"]\nruns = 3\ncontrollers = ["points", "motion-ga"]\n')
    table = load_campaign(file)
    longer_s = {0: 50.0, 1: 5.0, 2: 20.0}
    runs = [
        (spec, replace(RESULT, seconds=30.0 + longer_s[spec.seed], bound_s=30.0, dwelt=((3, 4, 2.0 + spec.seed),)))
        for spec in specs_of(table)
    ]
    (middle, first), (slowest, second) = heat_maps(table, runs, tmp_path)
    assert middle == "rooms, seed 2: 20.0 s beyond the bound, the middle of 3 grounds"
    assert slowest == "rooms, seed 0: 50.0 s beyond the bound, the most of 3 grounds"
    for figure, seed, title in ((first, 2, "points: reached, 50\u00a0s"), (second, 0, "points: reached, 80\u00a0s")):
        panels = [panel for panel in figure.axes if panel.images]
        assert panels[0].get_title(loc="left") == title and len(panels) == 2
        walls, spent = (image.get_array() for image in panels[0].images)
        assert np.array_equal(np.ma.filled(walls, 0.0) == 1.0, made("rooms", seed).world.obstacles)
        assert float(spent.max()) == 2.0 + seed


def test_a_ground_on_which_not_all_is_driven_yet_is_not_shown() -> None:
    table = CampaignTable(name="c", worlds=["rooms"], runs=2, controllers=["points", "motion-ga"])
    runs = [(spec, replace(RESULT, seconds=30.0 + 50.0 * spec.seed)) for spec in specs_of(table)]
    assert list(shown_seeds(runs)) == [0, 1] and list(shown_seeds(runs[:-1])) == [0]


def test_a_ground_on_which_a_run_gave_up_is_not_taken_for_an_easy_one() -> None:
    table = CampaignTable(name="c", worlds=["rooms"], runs=3, controllers=["points", "motion-ga"])
    runs = [(spec, replace(RESULT, seconds=30.0 + 50.0 * spec.seed)) for spec in specs_of(table)]
    gave_up = replace(RESULT, seconds=5.0, targets=RESULT.reached + 1)
    runs = [(spec, gave_up if spec.seed == 0 and spec.controller == "points" else one) for spec, one in runs]
    middle, last = shown_seeds(runs).items()
    assert (middle[0], last[0]) == (2, 0)
    assert last[1].startswith("1 target not reached, ") and "not reached" not in middle[1]


def test_long_names_of_faults_cover_nothing_and_stay_in_the_picture(tmp_path: Path) -> None:
    file = tmp_path / "c.toml"
    long = "; ".join(["link_outage start_s=10 since=driving duration_s=0.8", *2 * ["gps_noise start_s=60 metres=0.2"]])
    lists = f'runs = 1\ncontrollers = ["points", "motion-ga"]\nfaults = ["none", "{long}"]\n'
    file.write_text(f'worlds = ["rooms least_door_m=1.6 most_door_m=1.8 movers=3"]\n{lists}')
    table = load_campaign(file)
    runs = [(spec, replace(RESULT, dwelt=((12, 4, 8.0), (16, 37, 8.0)))) for spec in specs_of(table)]
    for figure in (times(table, runs), heat_maps(table, runs, tmp_path)[0][1]):
        FigureCanvasAgg(figure).draw()
        texts = [text for legend in figure.legends for text in legend.get_texts()]
        texts += [panel.title if panel.title.get_text() else panel._left_title for panel in figure.axes]
        texts += [panel.xaxis.label for panel in figure.axes if panel.get_visible()]
        boxes = [text.get_window_extent() for text in texts if text.get_text()]
        boxes += [panel.get_window_extent() for panel in figure.axes if panel.get_label() == "<colorbar>"]
        assert len(boxes) >= 5
        for number, box in enumerate(boxes):
            assert figure.bbox.x0 <= box.x0 and box.x1 <= figure.bbox.x1, texts[number].get_text()
            assert figure.bbox.y0 <= box.y0 and box.y1 <= figure.bbox.y1, texts[number].get_text()
            assert not any(box.overlaps(other) for other in boxes[number + 1 :]), texts[number].get_text()
