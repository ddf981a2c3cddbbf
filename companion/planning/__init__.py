"""Planners: each turns a problem (grid, start, target) into a path."""
