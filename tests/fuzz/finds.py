"""Bytes that once were too much for a reader: (target, bytes)."""

FINDS: tuple[tuple[str, bytes], ...] = (
    ("state", b"rover-companion state 2x\x00\n"),
    ("mission-toml", b"name = " + b"9" * 5000),
    ("settings", b"a = " + b"9" * 5000),
    ("settings", b"a = " + b"[" * 5000),
    ("settings", b'[planner.prm]\n"samples\\u0001" = 1\n'),
    ("settings", b'"two\\nlines" = 1\n'),
)
