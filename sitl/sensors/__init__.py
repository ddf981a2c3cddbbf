"""Simulated range sensors and what is wrong with them."""
