"""Field size: how large fields are where the mission does not say, by the rover and the extent of the ground.

Nouns: field size.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from companion.mission.mission import RoverSpec
from companion.settings import MappingSettings

STEP_M = 0.05
"""Sides of fields are whole multiples of this."""
RADII = 0.43
"""Where the rover keeps the circle round it clear, the middle of a field must lie in every gap that it should fit
through. With fields of so many radii a rover of 0.7 m drives through 1.0 m."""
MOST_FINE, MOST_FINE_PLANNED = 250_000, 3_900_000
"""Fields that may be small are so large that there are no more of them: searches take time. The second is for planned
motions, which search less often: nearly as many as a grid may have."""
ARC_RADII = 0.72
"""The same for a rover that turns in arcs. It needs wider gaps, so smaller fields are of no use."""
BEAMS_M = 1.0
"""With smaller fields a rover that sees with single beams tries narrower gaps, of whose edges it sees little: at gates
of 0.8 to 1.1 m it touched in 2 of 36 drives with fields of 0.5 m, in none of 36 with these."""
FINE_ENOUGH = 1.01
"""Times the side that narrow ground needs: no smaller fields are of use."""
FINER_M, FINER_SHARE = 0.05, 1.0 / 3.0
"""With small fields evidence is finer: this share of their side, and no less than FINER_M."""


@dataclass(frozen=True, slots=True)
class FieldSize:
    """``fine_m``: as small as narrow ground needs; ``most``: there are no more fields than this, if they may be small.

    A mission's own ``resolution_m`` counts instead; without one, it is the largest side that fields get.
    """

    fine_m: float
    most: int

    def side_m(self, area_m2: float, largest_m: float) -> float:
        """The side of a field on ground of this area."""
        return min(largest_m, max(self.fine_m, math.sqrt(area_m2 / self.most)))

    def may_be_finer(self, side_m: float) -> bool:
        """Whether smaller fields than those of this side would open more gaps."""
        return side_m > FINE_ENOUGH * self.fine_m


def field_size(rover: RoverSpec, settings: MappingSettings, *, narrow_sight: bool = False) -> FieldSize:
    """The size by the rover, and by whether it sees with single thin beams alone.

    For planned motions (``keeps`` "outline") no obstacle fits between two places of a field that are free.
    """
    if narrow_sight:
        return FieldSize(BEAMS_M, MOST_FINE)
    if settings.keeps == "outline":
        return FieldSize(_in_steps(map_radius_m(rover, settings) / math.sqrt(2.0)), MOST_FINE_PLANNED)
    radii = ARC_RADII if rover.turning_radius_m > 0.0 else RADII
    return FieldSize(_in_steps(radii * rover.radius_m), MOST_FINE)


def map_radius_m(rover: RoverSpec, settings: MappingSettings) -> float:
    """What the rover's middle keeps from obstacles on the map, by ``mapping.keeps``."""
    return rover.radius_m if settings.keeps == "circle" else rover.footprint.discs()[1] + settings.beside_m


def finer_evidence(settings: MappingSettings, resolution_m: float) -> MappingSettings:
    """Evidence for fields that follow from the rover: it decides which gaps are wide enough."""
    finer_m = FINER_M if settings.keeps == "outline" else max(FINER_M, FINER_SHARE * resolution_m)
    return settings.model_copy(update={"evidence_m": min(settings.evidence_m, finer_m)})


def sure_gap_m(rover: RoverSpec, settings: MappingSettings, resolution_m: float) -> float:
    """A gap of this width is open on the map wherever it lies and however it is turned, to a tenth of a metre.

    The middles of fields must form a way through it; for planned motions, with fields that are fine enough, the
    middles of evidence cells.
    """
    kept_m = map_radius_m(rover, settings) + settings.evidence_m
    fine_m = field_size(rover, settings).fine_m
    is_roomy = settings.keeps == "outline" and resolution_m <= FINE_ENOUGH * fine_m
    between_m = settings.evidence_m if is_roomy else resolution_m
    return math.ceil(10.0 * (2.0 * kept_m + math.sqrt(2.0) * between_m) - 0.5) / 10.0


def finer_gap_m(rover: RoverSpec, settings: MappingSettings, resolution_m: float) -> float:
    """The same with the evidence that such fields get."""
    return sure_gap_m(rover, finer_evidence(settings, resolution_m), resolution_m)


def _in_steps(size_m: float) -> float:
    return max(math.floor(size_m / STEP_M + 1e-9), 1) * STEP_M
