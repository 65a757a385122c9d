"""A lease for a part of a program: ``with robot.lease(seconds=0.5)``.

The server has the mechanism (``lobby.lease``, docs/safety.md): a connection that gives no sign of life for so long
loses what it moves.  Here a lease begins with a block and ends with it.
"""

from __future__ import annotations

from types import TracebackType

from urbihw.client.connection import Connection
from urbihw.client.core import LeaseTerm
from urbihw.client.errors import ClientError


class RequestLease:
    """What the connection moves in the block stops ``seconds`` after the last sign of life, and at the block's end."""

    def __init__(self, connection: Connection, seconds: float, fed: bool) -> None:
        """``fed``: the library gives the signs of life; else the program does, by ``feed`` or any command."""
        self._connection = connection
        self._term = LeaseTerm(float(seconds), fed)

    def feed(self) -> None:
        """Give a sign of life: the one for whom the program moves the robot is still there."""
        self._connection.sign_of_life()

    def __enter__(self) -> RequestLease:
        """Begin.  Raises UrbiError for a time that no lease can have, or why there is no answer."""
        self._connection.begin_lease(self._term)
        self._connection.feed_lease(self._term)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._connection.end_lease(self._term)
        except ClientError:
            if kind is None:
                raise  # else the error of the block tells more
