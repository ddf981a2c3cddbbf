"""Runs a recorded drive again, compares it, and explains a decision."""
