"""The simulated world behind the real ArduRover firmware."""
