"""``rover-companion guard``: the script for the autopilot that stops the rover when the companion falls silent."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from companion.cli.inputs import EXIT_BAD_INPUT, OutputError, in_folder, replaced, usable_settings
from companion.core.clock import WallClock
from companion.mavlink.file_upload import FileUpload, UploadEnd
from companion.mavlink.transport import LinkError, open_link
from companion.settings import LinkSettings, SettingsError
from companion.vehicle.guard import FILE, script

FOLDERS = ("/APM/scripts", "scripts")
"""On a board's SD card, and of the simulated firmware."""
LIMIT_S = 60.0
HEARD_S = 10.0
STEP_S = 0.02
EXIT_NOT_THERE, EXIT_NOBODY = 3, 4
WHAT_NEXT = (
    "SCR_ENABLE must be 1 and SCR_USER1 300 (milliseconds); then restart the autopilot, and `rover-companion doctor` "
    "shows whether it is there"
)
GONE = "; the script that was there may be gone: install it again before you restart the autopilot"
BY_HAND = "copy it to the folder APM/scripts of the autopilot's SD card (`rover-companion guard --write FILE`)"


def guard(
    write: Annotated[Path | None, typer.Option(help=f"Write it to this file or folder, there as {FILE}.")] = None,
    install: Annotated[str | None, typer.Option(help="Upload it to this autopilot: a link, as for `run`.")] = None,
    settings_file: Annotated[Path | None, typer.Option("--settings", help="TOML file, see docs/settings.md.")] = None,
) -> None:
    """Print the Lua script that guards the rover on the autopilot, write it to a file, or upload it.

    Exit code 2: bad input; 3: not uploaded; 4: no rover heard.
    """
    try:
        settings = usable_settings(settings_file).link
        text = script(settings.component_id)
        if write is not None:
            _write(write, text)
        if install is not None:
            _upload(install, settings, text.encode())
    except (SettingsError, OutputError, LinkError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error
    if write is None and install is None:
        typer.echo(text, nl=False)


def _write(place: Path, text: str) -> None:
    place = place / FILE if place.is_dir() else place
    if place.suffix != Path(FILE).suffix:
        raise OutputError(f"{place}: the autopilot runs only scripts whose names end in .lua; name one, like {FILE}")
    in_folder(place)
    with replaced(place) as new:
        new.write_text(text, encoding="utf-8")
    typer.echo(f"wrote {place}; copy it to the folder APM/scripts of the autopilot's SD card; {WHAT_NEXT}")


def _upload(place: str, settings: LinkSettings, data: bytes) -> None:
    """Upload it; leaves with an exit code if that fails. Raises LinkError."""
    link, clock = open_link(place), WallClock()
    upload = FileUpload(link, settings, [f"{folder}/{FILE}" for folder in FOLDERS], data)
    began_s = now_s = clock.now_s()
    try:
        while upload.end is None:
            heard = upload.heard
            if now_s - began_s > (LIMIT_S if heard else HEARD_S):
                upload.give_up()
            upload.step(now_s)
            clock.sleep_until_s(now_s + STEP_S)
            now_s = clock.now_s()
    except KeyboardInterrupt:
        if upload.removed:
            typer.echo(f"{place}: stopped{GONE}", err=True)
        raise
    finally:
        link.close()
    if upload.end is UploadEnd.DONE:
        typer.echo(f"uploaded to {upload.place}; {WHAT_NEXT}")
        return
    remedy = {
        UploadEnd.NO_ROVER: "check link and port",
        UploadEnd.ARMED: "disarm it first",
    }.get(upload.end, BY_HAND)
    typer.echo(f"{place}: {upload.end}; {remedy}{GONE if upload.removed else ''}", err=True)
    raise typer.Exit(EXIT_NOBODY if upload.end is UploadEnd.NO_ROVER else EXIT_NOT_THERE)
