"""From a path to a setpoint: controllers, and what keeps the rover from touching anything."""
