"""What range sensors show before it becomes map: newest scans, stuck sensors, moving objects."""
