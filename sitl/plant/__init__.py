"""The plant: the rover's motion, and the compiled main loop."""
