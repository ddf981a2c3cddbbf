"""The command line: ``rover-sitl``, one file a command."""
