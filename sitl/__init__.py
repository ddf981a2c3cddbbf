"""A light rover simulator that speaks ArduRover's MAVLink."""
