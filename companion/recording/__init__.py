"""The record of a run: written while it drives, read afterwards."""
