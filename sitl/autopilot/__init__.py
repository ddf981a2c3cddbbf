"""The autopilot that is simulated: ArduRover's face and its control of the rover, one concern a file."""
