"""The vehicle as the companion knows it: events from it, its state, commands to it."""
