"""The vehicle: events from it, its state, commands to it."""
