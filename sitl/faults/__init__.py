"""Fault injection: plans of faults, and their effects on links, sensors, GPS, wheels and power."""
