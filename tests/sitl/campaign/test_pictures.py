"""Pictures of a campaign's report: where the time went, for each combination by itself."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg

from sitl.campaign.campaign_file import load_campaign
from sitl.campaign.pictures import heat_maps, times
from sitl.campaign.run_spec import specs_of
from tests.sitl.campaign.test_run_store import RESULT

MISSION = Path(__file__).resolve().parents[3] / "missions" / "open.toml"


def test_each_combination_has_its_own_heat_map_in_the_same_colours(tmp_path: Path) -> None:
    shutil.copy(MISSION, tmp_path)
    file = tmp_path / "c.toml"
    file.write_text('worlds = ["open.toml", "rooms"]\nruns = 2\ncontrollers = ["points", "motion-ga"]\n')
    table = load_campaign(file)
    seconds = {"points": 8.0, "motion-ga": 2.0}
    runs = [(spec, replace(RESULT, dwelt=((3, 4, seconds[spec.controller]),))) for spec in specs_of(table)]
    ((world, figure),) = heat_maps(table, runs, tmp_path)
    assert world == "open.toml", "generated ground is another one for each seed"
    panels = [panel for panel in figure.axes if panel.images]
    assert [panel.get_title(loc="left") for panel in panels] == ["open, points: 2 runs", "open, motion-ga: 2 runs"]
    shown = [panel.images[-1] for panel in panels]
    assert [float(image.get_array().max()) for image in shown] == [8.0, 2.0]
    assert {image.get_clim() for image in shown} == {(0.0, 8.0)}


def test_long_names_of_faults_cover_nothing_and_stay_in_the_picture(tmp_path: Path) -> None:
    shutil.copy(MISSION, tmp_path)
    file = tmp_path / "c.toml"
    long = "; ".join(["link_outage start_s=10 since=driving duration_s=0.8", *2 * ["gps_noise start_s=60 metres=0.2"]])
    lists = f'runs = 2\ncontrollers = ["points", "motion-ga"]\nfaults = ["none", "{long}"]\n'
    file.write_text(f'worlds = ["open.toml", "rooms"]\n{lists}')
    table = load_campaign(file)
    runs = [(spec, replace(RESULT, dwelt=((3, 4, 8.0),))) for spec in specs_of(table)]
    for figure in (times(table, runs), heat_maps(table, runs, tmp_path)[0][1]):
        FigureCanvasAgg(figure).draw()
        texts = [text for legend in figure.legends for text in legend.get_texts()]
        texts += [panel.title if panel.title.get_text() else panel._left_title for panel in figure.axes]
        boxes = [text.get_window_extent() for text in texts if text.get_text()]
        boxes += [panel.get_window_extent() for panel in figure.axes if panel.get_label() == "<colorbar>"]
        assert len(boxes) >= 5
        for number, box in enumerate(boxes):
            assert figure.bbox.x0 <= box.x0 and box.x1 <= figure.bbox.x1, texts[number].get_text()
            assert not any(box.overlaps(other) for other in boxes[number + 1 :]), texts[number].get_text()
