"""Lidars on serial ports of the companion's own: bytes, points, scans."""
