"""The companion program: finds a rover's way to a mission's targets through ground nobody mapped."""
