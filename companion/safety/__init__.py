"""Who may drive, and whether it is safe to."""
