"""Missions: where to go, what to do there, and the files they come from."""
