"""What of an autopilot that has been examined would stop a mission."""
