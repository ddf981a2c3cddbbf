"""Searches for runs that break a rule: an optimiser moves world, rover, sensors, faults and settings."""
