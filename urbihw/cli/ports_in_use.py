"""Opens the line of a servo chain for the bring-up tools, and tells who has the port if it is in use."""

from __future__ import annotations

import errno

from urbihw.buses.errors import Unavailable
from urbihw.buses.link import serial_path
from urbihw.buses.servos.line import ServoLine
from urbihw.buses.servos.quiet import check_quiet
from urbihw.daemon.holders import daemon_of_file, holder_of_file


def open_line(url: str, baud: int | None = None) -> ServoLine:
    """Open a line, at `baud` bits per second instead of the url's own.

    Raises BadUrl; Unavailable, which names the process that has the port if that is the reason, and for a line that is
    not quiet.
    """
    try:
        line = ServoLine.open(url, baud)
    except Unavailable as error:
        path = serial_path(url)
        if error.errno != errno.EBUSY or not path:
            raise
        raise Unavailable(errno.EBUSY, in_use(path)) from error
    try:
        check_quiet(line)
    except BaseException:
        line.close()
        raise
    return line


def in_use(path: str) -> str:
    """The message for a port that another process has open."""
    daemon = daemon_of_file(path)
    if daemon:
        return f"{path} is in use by an urbihw daemon (process {daemon}): stop that first"
    holder = holder_of_file(path) or "another program"
    return f"{path} is in use by {holder}: close that first"
