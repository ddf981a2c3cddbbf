"""The command line: ``rover-companion``, one file a command."""
