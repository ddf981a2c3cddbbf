"""Executes the mission: the next goal, the way there, what is sent to the autopilot."""
