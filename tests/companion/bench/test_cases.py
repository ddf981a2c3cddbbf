"""The problems that planners are compared on."""

from pathlib import Path

import pytest

from companion.bench.cases import map_case, paper_cases
from companion.mapping.map_files import MapError

MAPS = Path(__file__).resolve().parents[3] / "missions" / "maps"


def test_the_four_maps_grow():
    small, large = (case for case in paper_cases(MAPS, (1, 4)) if case.name == "rooms")
    assert large.weights.shape == (200, 400) and large.fields == 16 * small.fields
    (start, target) = large.ends[0]
    assert large.weights[start.y, start.x] < 1.0 and large.weights[target.y, target.x] < 1.0


def test_a_map_without_problems_is_refused(tmp_path):
    file = tmp_path / "m.map"
    file.write_text("type octile\nheight 1\nwidth 2\nmap\n..\n")
    with pytest.raises(MapError, match="scenario file"):
        map_case(file, 5)
