"""The command line: ``rover-sitl``, one file per command."""
