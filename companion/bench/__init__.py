"""Planners and their peers on the same maps in one run."""
