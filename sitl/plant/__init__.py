"""The rover's motion, and the compiled main loop that drives it."""
