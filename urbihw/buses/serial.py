"""Serial lines: `/dev/ttyUSB0?baud=1000000` or `serial:///dev/ttyUSB0`; the path of a pty works too.

pyserial opens and configures the port (speeds, exclusive lock, low latency); the bytes go through `FdLink`.
"""

from __future__ import annotations

import contextlib
import errno
import os
import stat
from typing import Final

import serial

from urbihw.buses.errors import BadUrl, Unavailable
from urbihw.buses.fd import FdLink

_IN_USE = {errno.EWOULDBLOCK, errno.EBUSY}
_OTHERS: Final = ((stat.S_ISDIR, "folder"), (stat.S_ISREG, "file"), (stat.S_ISFIFO, "pipe"), (stat.S_ISSOCK, "socket"))


class SerialLink(FdLink):
    """8 data bits, no parity, 1 stop bit, raw, locked against other programs."""

    _port: serial.Serial | None = None

    def _open(self) -> None:
        path = self.url.target
        try:
            port = serial.Serial(path, self.baud, timeout=0, exclusive=True)
        except ValueError as error:
            raise BadUrl(f"{path} cannot run at {self.baud} baud; choose another ?baud=") from error
        except (OSError, serial.SerialException) as error:
            raise self._explain(error) from error
        # FTDI adapters keep an answer for up to 16 ms without this; ptys and some drivers do not know the flag.
        with contextlib.suppress(OSError, ValueError, NotImplementedError, AttributeError):
            port.set_low_latency_mode(True)
        self._port = port
        self._fd = port.fileno()
        # Bytes that the system had buffered before the port was opened answer no request of ours.
        with contextlib.suppress(OSError, serial.SerialException):
            port.reset_input_buffer()

    def set_dtr(self, on: bool) -> None:
        """See ``Link``; a pseudo terminal has no modem lines."""
        if self._port is not None:
            with contextlib.suppress(OSError, serial.SerialException):
                self._port.dtr = on

    def _explain(self, error: OSError) -> Unavailable:
        path = self.url.target
        if error.errno in _IN_USE or "exclusively lock" in str(error):
            return Unavailable(errno.EBUSY, f"{path} is in use by another program; close that one first")
        if error.errno in {errno.EACCES, errno.EPERM}:
            return Unavailable(
                errno.EACCES,
                f"no permission to open {path}: add yourself to the group dialout "
                "(sudo usermod -aG dialout $USER) and log in again",
            )
        if error.errno == errno.ENOENT or not os.path.exists(path):
            return Unavailable(errno.ENOENT, f"no such port: {path}; is the adapter plugged in?")
        return no_port(path) or Unavailable(error.errno or errno.EIO, f"cannot open {path}: {error}")

    def _close(self) -> None:
        port, self._port, self._fd = self._port, None, -1
        if port is not None:
            # Closing an unplugged port fails in the kernel; it is closed all the same.
            with contextlib.suppress(OSError, serial.SerialException):
                port.close()


def no_port(path: str) -> Unavailable | None:
    """Return the error for a path that is not a serial port; None if it may be one."""
    try:
        mode = os.stat(path).st_mode
        kind = next((f" but a {word}" for is_one, word in _OTHERS if is_one(mode)), "")
        if not kind and _is_terminal(path):
            return None
    except OSError:
        return None
    what_to_do = "name one such as /dev/ttyUSB0 (urbihw doctor shows those there are)"
    return Unavailable(errno.ENOTTY, f"{path} is no serial port{kind}; {what_to_do}")


def _is_terminal(path: str) -> bool:
    fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        return os.isatty(fd)
    finally:
        os.close(fd)
