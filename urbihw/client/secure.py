"""The client side of TLS, on a blocking socket that two threads share."""

from __future__ import annotations

import socket
import ssl
import threading
from typing import Final

from urbihw.client.credentials import OPTIONS, Denied, Words
from urbihw.client.login import LoginInterrupted
from urbihw.client.where import Where

CHUNK: Final = 64 * 1024
"""Bytes read at once.  Above 128 KiB each reading maps and unmaps memory, which costs 0.05 ms."""


def context() -> ssl.SSLContext:
    """A context for TLS 1.2 or later.  The certificate is checked by its fingerprint (``Credentials``), not by
    OpenSSL."""
    made = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    made.minimum_version = ssl.TLSVersion.TLSv1_2
    made.check_hostname = False
    made.verify_mode = ssl.CERT_NONE
    return made


def failed(where: Where, error: ssl.SSLError, words: Words = OPTIONS) -> Exception:
    """The exception for a failed TLS handshake."""
    if isinstance(error, ssl.SSLEOFError) or error.reason is None:
        return LoginInterrupted("it closed the connection")
    if error.reason == "WRONG_VERSION_NUMBER":
        return Denied(f"{where} does not speak TLS; if everybody on the way may read along and you trust them all: "
                      f"{words.no_tls}")
    return Denied(f"{where}: no TLS with it: {error.reason.replace('_', ' ').lower()}")


class TlsSocket:
    """TLS on a connected socket: a ``ClientSocket``.  Raises OSError or Denied when the handshake fails.

    Two threads must not read and write an SSLSocket at the same time, but the console in a pipe does.
    """

    def __init__(self, where: Where, plain: socket.socket, words: Words = OPTIONS) -> None:
        self.unread = b""
        """Bytes received during the login, which ``recv`` returns first."""
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
            raise failed(where, error, words) from error
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
        """Set the timeout of the other methods."""
        self._plain.settimeout(seconds)

    def sendall(self, data: bytes, /) -> None:
        with self._sending:  # records leave in the order in which they were made
            with self._state:
                self._tls.write(data)
                sealed = self._out.read()
            self._plain.sendall(sealed)

    def recv(self, size: int, /) -> bytes:
        """Receive at most ``size`` bytes; ``b""`` at the end of the connection."""
        if self.unread:
            data, self.unread = self.unread[:size], self.unread[size:]
            return data
        while True:
            try:
                with self._state:
                    return self._tls.read(size)
            except ssl.SSLWantReadError:
                self._fill()
            except ssl.SSLError:  # the end of the connection, with or without a close_notify
                return b""

    def shutdown(self, how: int, /) -> None:
        """End the connection, without the word of TLS for it."""
        self._plain.shutdown(how)

    def fileno(self) -> int:
        """The descriptor of the socket, to wait for bytes."""
        return self._plain.fileno()

    def has_unread(self) -> bool:
        """Whether bytes have come that were not received, so that there is nothing to wait for."""
        with self._state:
            return bool(self.unread) or self._tls.pending() > 0 or self._in.pending > 0

    def close(self) -> None:
        self._plain.close()
