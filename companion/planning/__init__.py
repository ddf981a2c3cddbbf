"""Path planners: each finds a path for a problem (grid, start, target)."""
