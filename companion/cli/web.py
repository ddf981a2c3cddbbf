"""Options of the live page, for every command that drives."""

from __future__ import annotations

import socket
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Annotated
from urllib.parse import quote

import typer

from companion.mavlink.local_station import LocalStation
from companion.mavlink.signing import Signer
from companion.viewer.live_viewer import LiveViewer
from companion.viewer.web_process import WebError, WebPlace, web_place

__all__ = ["Actions", "Token", "Web", "WebError", "asked_place", "served", "web_viewer"]

ALL_ADDRESSES = "0.0.0.0"
SOMEWHERE = ("192.0.2.1", 9)
"""An address that is nobody's: nothing is sent there."""

Web = Annotated[
    str | None,
    typer.Option("--web", metavar="[HOST:]PORT", help="Serve a page that shows the run (needs the extra `web`)."),
]
Token = Annotated[
    Path | None,
    typer.Option(
        "--web-token",
        metavar="FILE",
        help="File with a token, made if it does not exist: who knows it may look on from elsewhere, too.",
    ),
]


Actions = Annotated[
    bool,
    typer.Option(
        "--web-actions", help="Who knows the token may also pause the rover, send it somewhere, or skip a target."
    ),
]


def asked_place(web: str | None, token_file: Path | None) -> WebPlace | None:
    """Where a page was asked for; None for none. Raises WebError."""
    if web is None:
        if token_file is not None:
            raise WebError("--web-token: nothing is served; add --web PORT")
        return None
    return web_place(web, token_file)


def web_viewer(
    web: str | None,
    token_file: Path | None,
    say: Callable[[str], None],
    *,
    actions: bool = False,
    signer: Signer | None = None,
) -> LiveViewer | None:
    """The viewer that was asked for; None for none. ``signer``: of the companion that it asks. Raises WebError."""
    if actions and web is None:
        raise WebError("--web-actions: nothing is served; add --web PORT")
    if actions and token_file is None:
        raise WebError("--web-actions: only who knows a token may act: name a file for it with --web-token FILE")
    place = asked_place(web, token_file)
    return None if place is None else LiveViewer(place, say, LocalStation(signer) if actions else None)


def served(place: WebPlace, *, to_person: bool) -> str:
    """Where the page is. A person gets the token with it, behind a # that browsers keep; a log file does not."""
    token = f"#token={quote(place.token, safe='')}" if place.token and to_person else ""
    to_all = ", for all who can reach this address and know the token" if place.private else ""
    own = own_address() if place.host == ALL_ADDRESSES else None
    shown = place if own is None else replace(place, host=own)
    return f"the run is shown at {shown.url}{token}{to_all}"


def own_address() -> str | None:
    """The address at which the network reaches this computer; None without a network."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking:
        try:
            asking.connect(SOMEWHERE)  # chooses the interface, and sends nothing
        except OSError:
            return None
        return str(asking.getsockname()[0])
