"""Bounds how fast passwords can be tried: the wrong logins of each address are counted."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from urbihw_nao.qimessaging.call_limits import TokenBucket

WRONG_LOGINS: Final = 3
"""Wrong logins of one address at once."""
WRONG_LOGIN_S: Final = 2.0
"""Seconds for each further one."""
MOST_ADDRESSES: Final = 256
"""Addresses that are remembered; then the one is forgotten whose first wrong login was longest ago."""


class LoginGuard:
    """One for all doors that ask for the same password.

    While an address has no try left, its logins are refused without a look at the password, also right ones.
    """

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._tries: dict[str, TokenBucket] = {}

    @property
    def count(self) -> int:
        """How many addresses are remembered."""
        return len(self._tries)

    def find_refusal(self, address: str) -> str:
        """Why this address may not try now, "" if it may."""
        tries = self._tries.get(address)
        if tries is None or tries.has_token(self._now()):
            return ""
        return f"too many wrong logins from {address}: wait {WRONG_LOGIN_S:g} s"

    def count_wrong(self, address: str) -> None:
        """A login of this address was wrong."""
        now = self._now()
        if address not in self._tries:
            self._forget(now)
            self._tries[address] = TokenBucket(1 / WRONG_LOGIN_S, WRONG_LOGINS, now)
        self._tries[address].take(now)

    def _forget(self, now: float) -> None:
        if len(self._tries) < MOST_ADDRESSES:
            return
        self._tries = {address: tries for address, tries in self._tries.items() if not tries.is_full(now)}
        if len(self._tries) >= MOST_ADDRESSES:
            del self._tries[next(iter(self._tries))]
