"""Views of a simulation: what the terminal shows of the true world, and a picture file."""
