"""MAVLink: transports, codec, and the conversation with the autopilot."""
