"""Links that end in a file descriptor: serial lines and sockets share their reading and writing.

Bytes go through os.read, os.write and select directly. pyserial's own read costs 19 us of processor per answer against
8 us for this (measured for `reference/dynamixel.md`, 9.4), and poll() rounds its time-out up to whole milliseconds,
which is longer than a whole transaction.
"""

from __future__ import annotations

import os
import select

from urbihw.buses.errors import LinkGone
from urbihw.buses.link import Link

# A system buffer that stays full this long belongs to a line that no longer moves.
_WRITE_TIMEOUT_S = 1.0


class FdLink(Link):
    """A link over a non-blocking file descriptor; subclasses open it and put it into `_fd`."""

    _fd = -1

    def _read(self, size: int, deadline: float) -> bytes:
        try:
            if not self._wait_readable(deadline):
                return b""
            data = os.read(self._fd, size)
        except BlockingIOError:
            return b""
        except (OSError, ValueError) as error:
            raise LinkGone(f"{self.url.text}: reading failed ({error}); was it unplugged?") from error
        if not data:
            raise LinkGone(f"{self.url.text}: the other side closed; is it unplugged or switched off?")
        return data

    def _wait_readable(self, deadline: float) -> bool:
        """Return whether there is input before the deadline; note whether there was something to read beside."""
        fd = self._fd
        pause = deadline - self.clock.now()
        # The kernel looks once more before it reports a time-out, so a late wake-up of this process loses nothing.
        if self.beside:
            try:
                ready = select.select((fd, *self.beside), (), (), pause if pause > 0 else 0)[0]
            except (OSError, ValueError):
                # One of them was closed meanwhile; if it is the own one, the next call tells.
                self.beside = ()
            else:
                self.is_quiet = not ready or ready == [fd]
                if self.is_quiet or fd in ready:
                    return bool(ready)
            pause = deadline - self.clock.now()
        return bool(select.select((fd,), (), (), pause if pause > 0 else 0)[0])

    def is_writable(self) -> bool:
        """Return whether the descriptor accepts bytes now; false when it is closed."""
        return bool(self._fd >= 0 and select.select((), (self._fd,), (), 0)[1])

    def _write(self, data: bytes) -> None:
        view = data
        while view:
            try:
                sent = os.write(self._fd, view)
            except BlockingIOError:
                self._wait_writable()
                continue
            except OSError as error:
                raise LinkGone(f"{self.url.text}: writing failed ({error}); was it unplugged?") from error
            view = view[sent:]

    def _wait_writable(self) -> None:
        if not select.select((), (self._fd,), (), _WRITE_TIMEOUT_S)[1]:
            raise LinkGone(f"{self.url.text}: takes no bytes since {_WRITE_TIMEOUT_S:g} s; is the peer stuck?")
