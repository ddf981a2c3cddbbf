"""The viewer: one picture of a run, live in the browser or on the terminal, and afterwards as a report.

``map_tiles`` and ``frame`` say what is shown of a moment, as plain values; ``page/`` draws it.
"""
