"""Campaigns: many drives from one file, kept one by one, summed up with intervals."""
