"""Bytes in, bytes out: transports, the codec, and the autopilot at the other end."""
