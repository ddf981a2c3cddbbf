"""Ways from the network, and from serial lines, to the simulated vehicle."""

from sitl.network.address import FORMS, open_endpoint
from sitl.network.endpoint import Endpoint, ListenError

__all__ = ["FORMS", "Endpoint", "ListenError", "open_endpoint"]
