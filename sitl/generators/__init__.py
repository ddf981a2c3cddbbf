"""Worlds from seeds: kinds of ground with parameters, what makes one difficult, and moving things."""
