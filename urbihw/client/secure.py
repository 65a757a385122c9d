"""TLS as a client speaks it, and on a socket that two threads share."""

from __future__ import annotations

import socket
import ssl
import threading
from typing import Final

from urbihw.client.credentials import Denied
from urbihw.client.entrance import Turned
from urbihw.client.where import Where

CHUNK: Final = 256 * 1024


def context() -> ssl.SSLContext:
    """TLS 1.2 or later.  Whose certificate it is we judge ourselves, by its fingerprint."""
    made = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    made.minimum_version = ssl.TLSVersion.TLSv1_2
    made.check_hostname = False
    made.verify_mode = ssl.CERT_NONE
    return made


def failed(where: Where, error: ssl.SSLError) -> Exception:
    """What a failed handshake means."""
    if isinstance(error, ssl.SSLEOFError) or error.reason is None:
        return Turned("it closed the connection")
    if error.reason == "WRONG_VERSION_NUMBER":
        return Denied(f"{where} does not speak TLS; if everybody on the way may read along and you trust them all: "
                      "--no-tls")
    return Denied(f"{where}: no TLS with it: {error.reason.replace('_', ' ').lower()}")


class Secure:
    """TLS on a connected socket: a ``Wire`` (see ``connect``).  Raises OSError or Denied when it cannot be had.

    An SSLSocket may not be read and written by two threads at once, but the console in a pipe does.
    """

    def __init__(self, where: Where, plain: socket.socket) -> None:
        self.unread = b""
        """What came too early, to be received first."""
        self._plain = plain
        self._in, self._out = ssl.MemoryBIO(), ssl.MemoryBIO()
        self._tls = context().wrap_bio(self._in, self._out)
        self._state = threading.Lock()
        self._sending = threading.Lock()
        try:
            while not self._shaken():
                self._plain.sendall(self._out.read())
                self._fill()
        except ssl.SSLError as error:
            raise failed(where, error) from error
        self._plain.sendall(self._out.read())
        self.certificate = self._tls.getpeercert(binary_form=True) or b""

    def _shaken(self) -> bool:
        try:
            self._tls.do_handshake()
        except ssl.SSLWantReadError:
            return False
        return True

    def _fill(self) -> None:
        data = self._plain.recv(CHUNK)
        with self._state:
            if data:
                self._in.write(data)
            else:
                self._in.write_eof()

    def settimeout(self, seconds: float | None, /) -> None:
        """How long the others may take."""
        self._plain.settimeout(seconds)

    def sendall(self, data: bytes, /) -> None:
        """Send."""
        with self._sending:  # records leave in the order in which they were made
            with self._state:
                self._tls.write(data)
                sealed = self._out.read()
            self._plain.sendall(sealed)

    def recv(self, size: int, /) -> bytes:
        """What has come."""
        if self.unread:
            data, self.unread = self.unread[:size], self.unread[size:]
            return data
        while True:
            try:
                with self._state:
                    return self._tls.read(size)
            except ssl.SSLWantReadError:
                self._fill()
            except ssl.SSLError:  # the end, whether it was announced or not
                return b""

    def close(self) -> None:
        """Hang up."""
        self._plain.close()
