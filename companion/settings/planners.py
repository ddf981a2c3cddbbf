"""Settings of the planners, each with the section of the paper that it comes from."""

from __future__ import annotations

from pydantic import Field

from companion.settings.section import Section


class SedighiSettings(Section):
    """The genetic algorithm of Sedighi et al. 2004, and of its forerunners. The paper gives the weights only."""

    population: int = Field(200, ge=4, le=10_000, description="chromosomes of a generation (ours: not printed)")
    generations: int = Field(1000, ge=1, description="at most (ours: not printed)")
    most_genes: int = Field(
        40_000_000, ge=1, description="limit of genes tried in total: on large maps there are fewer generations (ours)"
    )
    settled_generations: int = Field(
        40, ge=1, description="generations after which a best path that is free and unchanged ends the search (ours)"
    )
    crossover_probability: float = Field(
        0.8, ge=0.0, le=1.0, description="of a pair of parents (IV.B; ours: not printed)"
    )
    mutated_genes: float = Field(
        1.5,
        ge=0.0,
        description="mean number in a chromosome: n times the mutation probability of each gene, of the flag and of "
        "each switch value (IV.C; ours: not printed)",
    )
    length_weight: float = Field(1.0, gt=0.0, description="L of equation 1")
    turn_weight: float = Field(2.0, ge=0.0, description="T of equation 1")
    infeasible_factor: float = Field(
        0.1, gt=0.0, le=1.0, description="the 0.1 of equation 2: factor on the fitness of a path with collisions"
    )


class VertexSettings(Section):
    """The genetic algorithm of Wang, Sillitoe & Mulvaney 2007."""

    population: int = Field(30, ge=4, le=10_000, description="chromosomes (table II)")
    generations: int = Field(
        1000,
        ge=1,
        description="with one operator each: limit until a feasible path, and again to improve it (table IV)",
    )
    populations: int = Field(
        5,
        ge=1,
        description="how many populations are tried in total: one without a feasible path after all its generations is "
        "replaced (ours; the paper gives no end, II.E)",
    )
    length_weight: float = Field(0.0, ge=0.0, description="w_d of equation 1: cost of a field of path")
    time_weight: float = Field(1.0, ge=0.0, description="w_t of equation 1: cost of a second")
    speed_levels: int = Field(
        5,
        ge=1,
        le=100,
        description="number of speeds, evenly spaced from the slowest to the fastest (II.B); 1: the fastest only",
    )
    safe_fields: float = Field(
        0.5,
        ge=0.5,
        description="safe distance from obstacle fields (II.A). The paper has 1 m for the robot's size; "
        "our maps include that in the obstacles",
    )
    mover_safe_fields: float = Field(
        1.0, ge=0.0, description="safe distance from moving obstacles, on every side of the exclusion area (II.A)"
    )
    mover_timing_s: float = Field(
        1.0,
        ge=0.0,
        description="seconds that the exclusion area extends along the obstacle's track, ahead and behind, "
        "and to both sides for the robot: how early or late either may be (II.A gives no figure)",
    )
    mover_corner_rows: int = Field(
        6,
        ge=1,
        le=1000,
        description="places of a moving obstacle's track whose corners are vertices (II.B; ours: not printed)",
    )
    shorter_side: float = Field(
        0.75,
        ge=0.0,
        le=1.0,
        description="probability that repair takes the shorter way round (II.D; ours: not printed)",
    )
    straight_line: bool = Field(
        True,
        description="one chromosome of the first population is the straight line (ours; off: all random, as in II.B)",
    )
    most_genes: int = Field(
        100_000, ge=2, description="maximum length of a chromosome, if the number of vertices + 2 is larger (ours)"
    )


class AchourSettings(Section):
    """The genetic algorithm of Achour & Chaalal 2011."""

    samples: int = Field(500, ge=1, le=100_000, description="M: free fields drawn for an attempt (V, VI)")
    neighbours: int = Field(
        5,
        ge=1,
        le=100,
        description="B: number of segments, to the nearest samples in sight, that are a generation's parents (VI)",
    )
    iterations: int = Field(500, ge=1, le=100_000, description="limit of an attempt (ours: the paper says finite)")
    attempts: int = Field(5, ge=1, le=10_000, description="each with new samples; environment 4 needed 5 (VII)")
    unit_fields: float = Field(
        1.0,
        gt=0.0,
        description="fields in the unit of length of equations 4 to 6; the paper's environments are some 20 units wide",
    )
    shorten: bool = Field(
        True, description="nodes between two that see each other are left out of the path found (ours)"
    )


class PrmSettings(Section):
    """The probabilistic roadmap of Achour & Chaalal 2011, section IV."""

    samples: int = Field(500, ge=1, le=10_000, description="M: drawn at first, and as many in each further round (VI)")
    neighbours: int = Field(5, ge=1, le=100, description="B: each node is linked with this many nearest nodes (IV, VI)")
    rounds: int = Field(
        4,
        ge=0,
        le=100,
        description="of extra samples in difficult regions (IV prints one, but table I has up to 2043 nodes)",
    )
    reach: float = Field(
        2.0,
        gt=0.0,
        description="how far from a difficult node extra samples lie, in mean distances between samples "
        "(ours: not printed)",
    )
    difficult_share: float = Field(
        0.5,
        ge=0.0,
        le=1.0,
        description="share of the extra samples near difficult nodes; the others lie anywhere (ours)",
    )
    weight_x: float = Field(1.0, gt=0.0, description="weight of x in the weighted L-infinity norm (IV; not printed)")
    weight_y: float = Field(1.0, gt=0.0, description="weight of y (IV; not printed)")


class PlannerSettings(Section):
    """The genetic algorithm of Kwasniewski & Gosiewski 2018, section 3."""

    way_points: int = Field(5, ge=3, le=64, description="points of the B-spline, joined by straight lines (3.4)")
    span_way_points: int = Field(
        2,
        ge=0,
        le=16,
        description="minimum of way points in each knot span: 5 in all at 4 control points, more with more of them, "
        "so that the path can become more complex (4.5). 0: always way_points",
    )
    mixing: float = Field(0.8, gt=0.5, le=1.0, description="D of equation 6: the better parent's share")
    selected_share: float = Field(
        0.25, gt=0.0, le=1.0, description="share of the best that is copied and crossed (3.5)"
    )
    mutation_probability: float = Field(0.4, ge=0.0, le=1.0, description="per gene (3.7)")
    mutation_range: float = Field(1.0, gt=0.0, description="h of 3.7 as a share of the smaller map dimension")
    line_probability: float = Field(
        0.5, ge=0.0, le=1.0, description="first third: probability to shift a point of the line (3.3)"
    )
    line_range: float = Field(
        0.2, ge=0.0, description="first third: largest shift, as a share of the smaller map dimension"
    )
    neighbourhood: float = Field(
        0.2, gt=0.0, description="second third: reach round the start, as a share of the smaller map dimension (3.3)"
    )
    margin_fields: int = Field(1, ge=0, description="third third: distance kept from the map's edge (3.3)")
    length_fitness: bool = Field(
        False,
        description="fields count by the length of the line over them: of two paths over equally many fields "
        "the straighter is fitter (ours; 3.4 counts fields). `hybrid` always does so",
    )
    adaptive: bool = Field(
        False,
        description="the number of control points is part of the chromosome: crossed, and changed by knot insertion "
        "and removal (ours; 7 names it as the open problem). A search then starts with one to two times each number "
        "of the budget",
    )
    most_control_points: int = Field(16, ge=3, le=64, description="adaptive: maximum of a chromosome (ours)")
    number_probability: float = Field(
        0.5, ge=0.0, le=1.0, description="adaptive: probability that a child gains or loses a control point (ours)"
    )
    islands: int = Field(
        1, ge=1, le=64, description="populations that evolve side by side; 1: the paper's algorithm (ours)"
    )
    migrate_every: int = Field(10, ge=1, description="epochs after which each island sends its best to the next (ours)")
    threads: int = Field(
        2, ge=1, le=64, description="islands computed at a time; changes the time of a search, never its result"
    )
    hybrid_tolerance: float = Field(
        1.01,
        ge=1.0,
        description="hybrid: limit of a genetic path's driving cost, as a multiple of the shortest path's",
    )
    obstacle_value: float = Field(
        100_000.0, ge=1000.0, description="VLN of 3.4: added to a path's fitness for each obstacle field"
    )
    sedighi: SedighiSettings = SedighiSettings()
    vertex: VertexSettings = VertexSettings()
    achour: AchourSettings = AchourSettings()
    prm: PrmSettings = PrmSettings()
