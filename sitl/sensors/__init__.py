"""Simulated range sensors and their flaws."""
