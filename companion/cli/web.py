"""Options of the live page, for every command that drives."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from companion.viewer.live_viewer import LiveViewer
from companion.viewer.web_process import WebError, web_place

__all__ = ["Token", "Web", "WebError", "served", "web_viewer"]

Web = Annotated[
    str | None,
    typer.Option("--web", metavar="[HOST:]PORT", help="Serve a page that shows the run (needs rover-companion[web])."),
]
Token = Annotated[
    Path | None,
    typer.Option(
        "--web-token",
        metavar="FILE",
        help="File with a token, made if it does not exist: who knows it may look on from elsewhere, too.",
    ),
]


def web_viewer(web: str | None, token_file: Path | None, say: Callable[[str], None]) -> LiveViewer | None:
    """The viewer that was asked for; None for none. Raises WebError."""
    if web is None:
        if token_file is not None:
            raise WebError("--web-token: nothing is served; add --web PORT")
        return None
    return LiveViewer(web_place(web, token_file), say)


def served(viewer: LiveViewer, *, to_person: bool) -> str:
    """Where the page is. A person gets the token with it, behind a # that browsers keep; a log file does not."""
    place = viewer.web.place
    token = f"#token={place.token}" if place.token and to_person else ""
    to_all = ", for all who can reach this address and know the token" if place.private else ""
    return f"the run is shown at {place.url}{token}{to_all}"
