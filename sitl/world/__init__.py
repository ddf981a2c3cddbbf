"""The simulated world: obstacles, doors, moving obstacles, ground; its own geodesy."""
