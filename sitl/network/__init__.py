"""Endpoints of the simulated vehicle: TCP, UDP and serial lines; the server; log lines."""

from sitl.network.address import FORMS, open_endpoint
from sitl.network.endpoint import Endpoint, ListenError

__all__ = ["FORMS", "Endpoint", "ListenError", "open_endpoint"]
