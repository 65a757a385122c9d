"""A check that a line is quiet before the bring-up tools ask it anything: servos speak only when they are asked."""

from __future__ import annotations

import errno
from typing import Final

from urbihw.buses.errors import Unavailable
from urbihw.buses.servos.line import ServoLine

_WINDOW: Final = 0.06
"""Seconds without a byte that make a line quiet: longer than an answer that is still under way."""
_WINDOWS: Final = 5
_MOST_BYTES: Final = 1 << 20
"""Read at most, so that a flood that fills a buffer faster than it is read ends the check too."""


def check_quiet(line: ServoLine) -> None:
    """Listen without sending until no byte comes for a moment; what came is discarded.

    Raises Unavailable when bytes keep coming: a sensor or a console, not servos, or another program that talks on the
    line. LinkGone.
    """
    link = line.link
    count, begin = 0, link.clock.now()
    for _ in range(_WINDOWS):
        before, end = count, link.clock.now() + _WINDOW
        while count < _MOST_BYTES and (data := link.read(4096, end)):
            count += len(data)
        if count == before < _MOST_BYTES:
            return
    seconds = link.clock.now() - begin
    raise Unavailable(
        errno.EIO,
        f"{line.name}: garbage on this port at {line.baud} bps: {count} bytes in {seconds:.1f} s without a question; "
        "is it another device, a bad cable, or does another program talk on the line?",
    )
