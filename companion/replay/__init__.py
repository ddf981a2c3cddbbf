"""A recorded run again: compared, and explained."""
