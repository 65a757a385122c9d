"""Serial lines: `/dev/ttyUSB0?baud=1000000` or `serial:///dev/ttyUSB0`; the path of a pty works too.

pyserial opens and configures the port (speeds, exclusive lock, low latency); the bytes go through `FdLink`.
"""

from __future__ import annotations

import contextlib
import errno
import os

import serial

from urbihw.buses.errors import BadUrl, Unavailable
from urbihw.buses.fd import FdLink

_IN_USE = {errno.EWOULDBLOCK, errno.EBUSY}


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
        # Bytes that waited in the system before we came answer nobody of us.
        with contextlib.suppress(OSError, serial.SerialException):
            port.reset_input_buffer()

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
        return Unavailable(error.errno or errno.EIO, f"cannot open {path}: {error}")

    def _close(self) -> None:
        port, self._port, self._fd = self._port, None, -1
        if port is not None:
            # Closing an unplugged port fails in the kernel; it is closed all the same.
            with contextlib.suppress(OSError, serial.SerialException):
                port.close()
