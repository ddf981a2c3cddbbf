"""Map colours: what the ground looks like in files, as on the page in the light.

Nouns: map colour.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

UNKNOWN_COLOUR = (159, 169, 179)
CELL_COLOURS: NDArray[np.uint8] = np.array(
    [UNKNOWN_COLOUR, (255, 255, 255), (18, 24, 30), (233, 201, 220), (242, 227, 179)], np.uint8
)
"""Red, green and blue by the class of a cell: unknown, free, obstacle, closed, costly."""
