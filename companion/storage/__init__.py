"""Files on a disk: read safely, written whole, away from the loop."""
