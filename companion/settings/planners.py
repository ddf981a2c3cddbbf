"""The settings of the planners."""

from __future__ import annotations

from pydantic import Field

from companion.settings.section import Section


class PlannerSettings(Section):
    """The genetic algorithm of Kwasniewski & Gosiewski 2018, section 3."""

    way_points: int = Field(
        5, ge=3, le=64, description="points of the B-spline that are joined by straight lines (3.4)"
    )
    span_way_points: int = Field(
        2,
        ge=0,
        le=16,
        description="but at least so many in each knot span: 5 at 4 control points, more with more of them, or the path "
        "could not become more complex (4.5). 0: always way_points",
    )
    mixing: float = Field(0.8, gt=0.5, le=1.0, description="D of equation 6: the better parent's share")
    selected_share: float = Field(0.25, gt=0.0, le=1.0, description="best part that is copied and crossed (3.5)")
    mutation_probability: float = Field(0.4, ge=0.0, le=1.0, description="per gene (3.7)")
    mutation_range: float = Field(1.0, gt=0.0, description="h of 3.7 as a share of the smaller map dimension")
    line_probability: float = Field(
        0.5, ge=0.0, le=1.0, description="first third: chance to shift a point of the line (3.3)"
    )
    line_range: float = Field(
        0.2, ge=0.0, description="first third: largest shift, as a share of the smaller map dimension"
    )
    neighbourhood: float = Field(
        0.2, gt=0.0, description="second third: reach round the start, as a share of the smaller map dimension (3.3)"
    )
    margin_fields: int = Field(1, ge=0, description="third third: distance kept from the map's edge (3.3)")
    obstacle_value: float = Field(
        100_000.0, ge=1000.0, description="VLN of 3.4: what an obstacle field adds to a path's fitness"
    )
