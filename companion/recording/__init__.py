"""Writes the record of a run while it drives, and reads it back."""
