"""What every other package speaks of: places and frames, the grid, the clock, a scan, a rover's limits."""
