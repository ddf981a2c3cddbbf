"""Compiled motion control: from what a mode wants to servo outputs, in every main loop."""
