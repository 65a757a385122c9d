"""A servo line whose speed can be changed: for scans of all speeds and for changes of a servo's speed."""

from __future__ import annotations

from collections.abc import Callable

from urbihw.buses import port_for
from urbihw.buses.link import Context, Link, Url, byte_link, has_line_speed

OpenAt = Callable[[int], Link]


class ServoLine:
    """The wire of a servo chain, open at one speed at a time.

    Attributes:
        link: the open link.
        name: its url without options, for messages.
        has_speed: whether the speed can be set from here: true for a serial port, false behind TCP.
    """

    def __init__(self, name: str, open_at: OpenAt, baud: int, *, has_speed: bool) -> None:
        self.name = name
        self.has_speed = has_speed
        self._open_at = open_at
        self.link = open_at(baud)

    @classmethod
    def open(cls, url: str, baud: int | None = None, context: Context | None = None) -> ServoLine:
        """Open the line of a url, at `baud` bits per second instead of its own. Raises BadUrl, Unavailable."""
        first = _closed(url, context)

        def open_at(speed: int) -> Link:
            link = _closed(url, context)
            link.baud = speed
            link.open()
            return link

        return cls(url.partition("?")[0], open_at, baud or first.baud, has_speed=has_line_speed(first))

    @property
    def baud(self) -> int:
        """Its present speed in bits per second."""
        return self.link.baud

    def set_speed(self, baud: int) -> Link:
        """Open it at another speed and return the link; nothing happens at the present one.

        Raises BadUrl if the port has no such speed, Unavailable; the line is open at its former speed then.
        """
        if baud != self.baud:
            before = self.baud
            self.link.close()
            try:
                self.link = self._open_at(baud)
            except Exception:
                self.link = self._open_at(before)
                raise
        return self.link

    def close(self) -> None:
        """Close it; calling it twice is fine."""
        self.link.close()

    def __enter__(self) -> ServoLine:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def names_speed(url: str) -> bool:
    """Return whether a url says at which speed the line runs. Raises BadUrl."""
    return "baud" in Url.parse(url).options


def _closed(url: str, context: Context | None) -> Link:
    return byte_link(port_for(url, context or Context()))
