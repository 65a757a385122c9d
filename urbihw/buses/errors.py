"""What can go wrong on a bus.

The tree, drawn by the moment a failure happens::

    BusError
      BadUrl            setup    the url cannot be understood                        (also a ValueError)
      Unavailable       setup    no such port, no rights, in use, library missing    (also an OSError)
      LinkGone          use      the adapter was unplugged, the peer closed          (also a ConnectionError)
      BusTimeout        use      no answer came in time                             (also a TimeoutError)
      BadFrame          use      an answer came, but damaged                         (also a ValueError)
      DeviceRefused     use      the device answered "no": a code and its meaning
      BadValue          use      a value or a name that this device cannot take      (also a ValueError)

Every message says what happened, where, and what to do about it. Foreign exceptions (OSError, SerialException) are
translated once, in the link that meets them.
"""

from __future__ import annotations


class BusError(Exception):
    """Base of everything that `urbihw.buses` raises on purpose."""


class BadUrl(BusError, ValueError):
    """The url of a bus cannot be understood; nothing was opened."""


class Unavailable(BusError, OSError):
    """The bus cannot be opened now: no such port, no rights, in use, connection refused, library missing."""

    def __str__(self) -> str:
        # An OSError would put its number in front of the words, which does not help the reader.
        return self.strerror or super().__str__()


class LinkGone(BusError, ConnectionError):
    """An open link stopped working: adapter unplugged, peer closed, or `close()` was called before."""


class BusTimeout(BusError, TimeoutError):
    """No answer came before the deadline."""


class BadFrame(BusError, ValueError):
    """Bytes came, but they do not make a valid answer."""


class BadValue(BusError, ValueError):
    """A value, an item name or an address that cannot be sent to this device."""


class DeviceRefused(BusError):
    """The device answered with an error.

    Attributes:
        device: id of the device.
        code: the error as sent, protocol specific.
        meaning: the same in words.
    """

    def __init__(self, device: int, code: int, meaning: str) -> None:
        super().__init__(f"device {device} refused: {meaning} (code 0x{code:02X})")
        self.device = device
        self.code = code
        self.meaning = meaning
