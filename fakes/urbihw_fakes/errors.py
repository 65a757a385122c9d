"""Everything this package raises on purpose.

FakeError
  AdapterGone (also OSError)         in-memory read or write while the adapter is unplugged
  UnknownRequest (also ValueError)   a word, a name or a value that the fake does not know
  NoSuchUnit (also LookupError)      nothing on the bus has that number
"""


class FakeError(Exception):
    """Base of all errors of this package."""


class AdapterGone(FakeError, OSError):
    """The adapter is unplugged; what a serial port reports as a hang-up."""


class UnknownRequest(FakeError, ValueError):
    """A fault word, a register name or a value that makes no sense here."""


class NoSuchUnit(FakeError, LookupError):
    """No unit with this number is on the bus."""
