"""Start and end of both scripts: interrupts, wrong usage and a full output in one line."""

from __future__ import annotations

import errno
import os
import reprlib
import signal
import sys
from collections.abc import Callable
from types import FrameType
from typing import TYPE_CHECKING, cast

from companion.cli import kernel_cache
from companion.core.interrupts import Terminated, is_interrupt, none_lost
from companion.core.own_parts import OwnPartError

if TYPE_CHECKING:  # loaded when something is wrong, as they take long
    import typer
    from pydantic_core import ErrorDetails

EXIT_USAGE, EXIT_STOPPED = 2, 130
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


class StoppedError(Exception):
    """Ctrl-C or SIGTERM has ended a command that adds a line about it; the text does not name the signal."""


def start(name: str, load: Callable[[], Callable[..., object]]) -> int:
    """Load the commands and run one; returns the exit code.

    Loading them imports the compiler and takes most of a second, in which an interrupt must not end in a traceback.
    """
    if fault := unsuitable(sys.maxsize):
        print(f"{name}: {fault}", file=sys.stderr)
        return EXIT_USAGE
    try:
        kernel_cache.use_cache(os.environ)
    except OSError as error:
        print(
            f"{name}: no place for compiled kernels ({error.strerror or error}); set {kernel_cache.PLACE}",
            file=sys.stderr,
        )
        return EXIT_USAGE
    terminated = _Terminated()
    before = signal.signal(signal.SIGTERM, terminated)
    try:
        with none_lost():
            return _run(name, load())
    except KeyboardInterrupt:
        print(f"{name}: stopped by {terminated.what}", file=sys.stderr)
        return EXIT_STOPPED
    except StoppedError as stopped:
        print(f"stopped by {terminated.what}: {stopped}", file=sys.stderr)
        return EXIT_STOPPED
    finally:
        signal.signal(signal.SIGTERM, before)


class _Terminated:
    """SIGTERM ends a command like Ctrl-C, from its start on; a process that it has started ends at once."""

    def __init__(self) -> None:
        self.asked = False
        self._process = os.getpid()

    @property
    def what(self) -> str:
        """The signal that has interrupted."""
        return "SIGTERM" if self.asked else "Ctrl-C"

    def __call__(self, number: int, frame: FrameType | None) -> None:
        if os.getpid() != self._process:
            signal.signal(number, signal.SIG_DFL)
            os.kill(os.getpid(), number)
        self.asked = True
        raise Terminated


def unsuitable(greatest_int: int) -> str:
    """Why this machine is unsuitable, in words; empty if it is not. ``greatest_int`` is ``sys.maxsize``."""
    if greatest_int < 2**32:
        return (
            "needs a 64-bit system, and this Python is a 32-bit one; on a Raspberry Pi install Raspberry Pi OS (64-bit)"
        )
    return ""


def _run(name: str, commands: Callable[..., object]) -> int:
    import typer

    # typer contains its own click and does not export the base class of usage errors.
    usage_error = cast(type[typer.BadParameter], typer.BadParameter.__base__)
    try:
        code = commands(prog_name=name, standalone_mode=False)
        _let_go_of_output()  # a command that goes on without a reader has its own exit code
    except typer.Abort:  # raised by older versions of typer on an interrupt
        raise KeyboardInterrupt from None
    except usage_error as error:
        where = error.ctx.command_path if error.ctx is not None else name
        print(f"{where}: {_words(error)}{_got(error)} (see {where} --help)", file=sys.stderr)
        return EXIT_USAGE
    except OwnPartError as error:
        print(error, file=sys.stderr)
        return EXIT_USAGE
    except SystemError as error:  # an interrupt inside a compiled loop
        if is_interrupt(error):
            raise KeyboardInterrupt from None
        raise
    except BrokenPipeError:  # the reader has closed its end (`... | head`)
        _let_go_of_output()
        return 1
    except OSError as error:
        if error.errno not in FULL or error.filename is not None:  # commands report errors of their own files
            raise
        _let_go_of_output()
        print(f"{name}: standard output cannot be written: {error.strerror}", file=sys.stderr)
        return EXIT_USAGE
    if code == EXIT_STOPPED:  # returned by newer versions on an interrupt, without a message
        raise KeyboardInterrupt
    return code if isinstance(code, int) else 0


def _words(error: typer.BadParameter) -> str:
    """A usage error without pydantic's own words, and without a full stop, as more may follow."""
    from companion.storage.plain_words import plain

    message, fault = error.format_message(), _fault_behind(error)
    return (message if fault is None else message.replace(fault["msg"], plain(fault))).rstrip(".")


def _got(error: Exception) -> str:
    """The value that was given, which newer versions of typer leave out of their words; empty if it is not known."""
    from companion.storage.validation import number_hint

    fault = _fault_behind(error)
    if fault is None:
        return ""
    value = fault["input"]
    if repr(value) in fault["msg"]:  # as of a name that is none of those known
        return ""
    return f", got {reprlib.repr(value)}{number_hint(value)}"


def _fault_behind(error: Exception) -> ErrorDetails | None:
    """What pydantic has found wrong; None where it was not asked."""
    from pydantic import ValidationError

    cause = error.__cause__
    return cause.errors(include_url=False)[0] if isinstance(cause, ValidationError) else None


def _let_go_of_output() -> None:
    """Discard output that cannot be written: Python would report it again when it flushes at the end."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
