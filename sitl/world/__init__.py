"""The truth: obstacles, doors, what moves, where the rover is."""
