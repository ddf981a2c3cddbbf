"""The map of what the sensors have seen, and what can be asked of it."""
