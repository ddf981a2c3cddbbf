"""Views of a simulation: on the terminal and as a picture file."""
