"""A bus at the other end of a TCP connection: `socket://host:port`, for instance ser2net or a fake robot.

`?baud=` tells how fast the wire behind the connection is; time-outs are computed from it.
"""

from __future__ import annotations

import contextlib
import errno
import socket

from urbihw.buses.errors import BadUrl, Unavailable
from urbihw.buses.fd import FdLink
from urbihw.buses.link import Context, Url

_CONNECT_TIMEOUT_S = 2.0


class TcpLink(FdLink):
    """A TCP client link without Nagle's delay; it must be connected within `connect_timeout_s`."""

    _socket: socket.socket | None = None
    connect_timeout_s = _CONNECT_TIMEOUT_S

    def __init__(self, url: Url, context: Context) -> None:
        super().__init__(url, context)
        self._address = self._find_address(url)

    def _find_address(self, url: Url) -> tuple[str, int]:
        """Host and port that a url names. Raises BadUrl."""
        host, separator, port = url.target.rpartition(":")
        if not separator or not host or not port.isdigit() or int(port) > 65535:
            raise BadUrl(f"bus url {url.text!r}: write socket://host:port, for instance socket://localhost:6000")
        return host.strip("[]"), int(port)

    @property
    def local_host(self) -> str:
        """The address of this computer on the open connection."""
        assert self._socket is not None
        host: str = self._socket.getsockname()[0]
        return host

    @property
    def peer_host(self) -> str:
        """The address of the other side of the open connection."""
        assert self._socket is not None
        host: str = self._socket.getpeername()[0]
        return host

    def _open(self) -> None:
        try:
            link = socket.create_connection(self._address, timeout=self.connect_timeout_s)
        except UnicodeError as error:
            raise Unavailable(errno.EINVAL, f"{self._address[0]!r} cannot be the name of a host") from error
        except OSError as error:
            host, port = self._address
            raise Unavailable(
                error.errno or 0, f"cannot connect to {host}:{port} ({error}); is the other side running?"
            ) from error
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        link.setblocking(False)
        self._socket = link
        self._fd = link.fileno()

    def _close(self) -> None:
        link, self._socket, self._fd = self._socket, None, -1
        if link is not None:
            with contextlib.suppress(OSError):
                link.close()
