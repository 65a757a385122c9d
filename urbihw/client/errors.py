"""The errors of the client library.  Each has a second parent of Python's own, for programs that know only that one."""

from __future__ import annotations


class ClientError(Exception):
    """The parent of all errors here; the message is one line that tells what to do."""


class CannotConnect(ClientError, ConnectionError):
    """No server answers at this address; ``reason`` is the cause in a few words."""

    def __init__(self, text: str, reason: str = "") -> None:
        super().__init__(text)
        self.reason = reason


class AccessDenied(ClientError, PermissionError):
    """The server refuses the client, or the client does not trust the server: to try again would not help."""


class ConnectionLost(ClientError, ConnectionError):
    """The connection ended before the answer: whether the command was carried out is unknown, so it is not repeated.
    The next command connects again.
    """


class TimedOut(ClientError, TimeoutError):
    """The server did not answer in time; a late answer is ignored."""


class BadAnswer(ClientError, ValueError):
    """The server sent what cannot be read: it is no server of urbiscript, or something on the way changed it.  The
    connection can still be used.
    """


class UrbiError(ClientError, RuntimeError):
    """An error of urbiscript.

    Attributes:
        text: the message, without the location.
        location: where in the text that was sent, such as ``1.1-3``: line and columns; "" if that does not help.
        kind: the class of urbiscript's exception, such as ``Lookup`` or ``Syntax``; "" for a thrown value.
        calls: the calls that led there, innermost first, a line each.
    """

    def __init__(self, text: str, location: str = "", kind: str = "", calls: tuple[str, ...] = ()) -> None:
        super().__init__(f"{location}: {text}" if location else text)
        self.text = text
        self.location = location
        self.kind = kind
        self.calls = calls


class SlotMissing(UrbiError, AttributeError):
    """There is no such slot, so that ``hasattr(robot, "motor99")`` is False."""
