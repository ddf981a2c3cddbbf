"""Saves the state of a run to disk, and resumes a run that was interrupted."""
