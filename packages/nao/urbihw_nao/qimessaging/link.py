"""``qi://`` and ``qis://``: the connection to NAOqi on a robot, by its address; plain, and encrypted (TLS).

The port is 9559, or 9503 for ``qis://``, where none is written.  The certificate of a robot is signed by itself, so
no authority vouches for it: ``?fingerprint=`` pins it, ``?ca=`` names a file of certificates of which one must have
signed it.  Without either the connection is encrypted, but its other end is anybody; ``warning`` says so.

Bytes that wait in this computer would make a stop late, and a robot that acknowledges nothing any more must be given up
soon, for what it was told to do it goes on doing.
"""

from __future__ import annotations

import errno
import hashlib
import socket
import ssl
from collections.abc import Mapping
from typing import Final

from urbihw.buses.errors import BadUrl, LinkGone, Unavailable
from urbihw.buses.link import Context, Url
from urbihw.buses.tcp import TcpLink
from urbihw.settings import TEXT, SettingRule
from urbihw_nao.qimessaging.login import describe_closed_port

PORT: Final = 9559
TLS_PORT: Final = 9503
"""The port of NAOqi 2.9 (fact sheet, section 3)."""
LINE_BITS: Final = 54_000_000
"""Bits per second of a network that a Nao may be in (802.11g), for the load that is shown."""
LOST_S: Final = 2.0
"""Seconds in which a robot must acknowledge what was sent."""
HANDSHAKE_FACTOR: Final = 2.0
"""The handshake of TLS may take this much longer than connecting: a robot of 2008 computes slowly."""
_READ_BYTES: Final = 65536
_PIN: Final = frozenset("0123456789abcdef")


def split_address(url: Url, default_port: int) -> tuple[str, int]:
    """Host and port of a url; the port may be left out.  Raises BadUrl."""
    host, colon, port = url.target.partition(":")
    if not host or (colon and not (port.isascii() and port.isdigit() and len(port) < 6 and 0 < int(port) < 65536)):
        raise BadUrl(f"bus url {url.text!r}: write {url.scheme}://host or {url.scheme}://host:port")
    return host, int(port) if colon else default_port


class QiLink(TcpLink):
    """A connection to a server of QiMessaging."""

    default_port = PORT

    def __init__(self, url: Url, context: Context) -> None:
        super().__init__(url, context)
        self.baud = LINE_BITS

    @classmethod
    def parameters(cls, url: Url) -> Mapping[str, SettingRule]:
        """Return no rules: there are no parameters."""
        return {}

    def _find_address(self, url: Url) -> tuple[str, int]:
        return split_address(url, self.default_port)

    def _open(self) -> None:
        try:
            super()._open()
        except Unavailable as error:
            cause = error.__cause__
            reason = getattr(cause, "strerror", None) or str(cause)
            text = describe_closed_port(*self._address, reason)
            raise Unavailable(error.errno or errno.EHOSTUNREACH, text) from error
        assert self._socket is not None
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, round(LOST_S * 1000))


class QisLink(QiLink):
    """The same over TLS."""

    default_port = TLS_PORT

    def __init__(self, url: Url, context: Context) -> None:
        super().__init__(url, context)
        self._pin = str(self.options.get("fingerprint", "")).replace(":", "").lower()
        if self._pin and (len(self._pin) != 64 or not _PIN.issuperset(self._pin)):
            raise BadUrl(f"bus url {url.text!r}: fingerprint must be the 64 hexadecimal digits of a SHA-256")
        self._ca = str(self.options.get("ca", ""))
        self._in, self._out = ssl.MemoryBIO(), ssl.MemoryBIO()
        self._tls: ssl.SSLObject | None = None

    @classmethod
    def parameters(cls, url: Url) -> Mapping[str, SettingRule]:
        """Return the rules of ``fingerprint`` and ``ca``."""
        return {"fingerprint": TEXT, "ca": TEXT}

    # ---------------------------------------------------------------- opening

    def _open(self) -> None:
        context = self._make_context()
        super()._open()
        try:
            self._shake_hands(context)
            self._check_pin()
        except LinkGone as error:
            self._close()
            raise Unavailable(errno.EPROTO, f"{self.url.text}: the other side hangs up in the TLS handshake") from error
        except Unavailable:
            self._close()
            raise

    def _close(self) -> None:
        self._tls = None
        super()._close()

    def _make_context(self) -> ssl.SSLContext:
        made = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        made.minimum_version = ssl.TLSVersion.TLSv1_2
        # A robot has many names and addresses, and its certificate none of them.
        made.check_hostname = False
        made.verify_mode = ssl.CERT_NONE
        if self._ca:
            made.verify_mode = ssl.CERT_REQUIRED
            try:
                made.load_verify_locations(self._ca)
            except (OSError, ssl.SSLError) as error:
                raise Unavailable(errno.ENOENT, f"{self.url.text}: ca: {self._ca}: {error}") from error
        return made

    def _shake_hands(self, context: ssl.SSLContext) -> None:
        """Do the handshake of TLS.  Raises Unavailable, LinkGone."""
        self._in, self._out = ssl.MemoryBIO(), ssl.MemoryBIO()
        self._tls = tls = context.wrap_bio(self._in, self._out)
        timeout = HANDSHAKE_FACTOR * self.connect_timeout_s
        deadline = self.clock.now() + timeout
        while True:
            try:
                tls.do_handshake()
                break
            except ssl.SSLWantReadError:
                self._flush()
                data = super()._read(_READ_BYTES, deadline)
                if not data:
                    text = f"{self.url.text}: no TLS handshake in {timeout:g} s; does it want qi://?"
                    raise Unavailable(errno.ETIMEDOUT, text) from None
                self._in.write(data)
            except ssl.SSLCertVerificationError as error:
                text = f"{self.url.text}: its certificate is not signed by one of {self._ca}: {error.verify_message}"
                raise Unavailable(errno.EACCES, text) from error
            except ssl.SSLError as error:
                reason = (error.reason or str(error)).replace("_", " ").lower()
                text = f"{self.url.text}: no TLS with it ({reason}); does it want qi://?"
                raise Unavailable(errno.EPROTO, text) from error
        self._flush()

    def _check_pin(self) -> None:
        """Compare the certificate with the pin, or warn that there is none.  Raises Unavailable."""
        assert self._tls is not None
        found = hashlib.sha256(self._tls.getpeercert(binary_form=True) or b"").hexdigest()
        shown = ":".join(found[at : at + 2] for at in range(0, len(found), 2)).upper()
        if self._pin and found != self._pin:
            raise Unavailable(
                errno.EACCES,
                f"{self.url.target}: its certificate is another than the pinned one: its fingerprint is {shown}; if "
                "the robot was installed anew, pin this one",
            )
        if not self._pin and not self._ca:
            self.warning = (
                "encrypted, but the certificate of the robot is not verified: pin it by ?fingerprint="
                f"{shown} behind the url"
            )

    # ---------------------------------------------------------------- bytes

    def _read(self, size: int, deadline: float) -> bytes:
        while True:
            try:
                assert self._tls is not None
                data = self._tls.read(size)
            except ssl.SSLWantReadError:
                self._flush()
                data = super()._read(_READ_BYTES, deadline)
                if not data:
                    return b""
                self._in.write(data)
                continue
            except ssl.SSLError as error:
                raise LinkGone(f"{self.url.text}: TLS has failed ({error.reason or error})") from error
            if not data:
                raise LinkGone(f"{self.url.text}: the other side closed; is it switched off?")
            return data

    def _write(self, data: bytes) -> None:
        assert self._tls is not None
        try:
            self._tls.write(data)
        except ssl.SSLError as error:
            raise LinkGone(f"{self.url.text}: TLS has failed ({error.reason or error})") from error
        self._flush()

    def _flush(self) -> None:
        data = self._out.read()
        if data:
            super()._write(data)
