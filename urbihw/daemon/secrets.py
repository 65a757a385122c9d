"""Secrets by which others get in: the tokens of programs, the codes and cookies of browsers.

A secret is random, shown once, and stored as a salted hash.  The answer to a wrong one is delayed, longer each time, to
spare the log and the processor.  A right one never waits, so an attacker (or a forgotten program with an old token)
behind the same address does not keep others out.
"""

from __future__ import annotations

import hashlib
import hmac
import re
import secrets
import time
from collections.abc import Callable, Iterable
from typing import Final, Protocol, TypeVar

NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.@-]{0,63}")
"""What the owner of a secret may be called."""
NAME_RULE: Final = "give letters, digits and . _ @ -, at most 64, such as"
FORGET_S: Final = 300.0
"""Seconds after the last wrong secret after which an address begins anew."""
MAX_ADDRESSES: Final = 256
"""Maximum number of addresses whose wrong secrets are counted; the least recent one is dropped for a new one."""


class Stored(Protocol):
    """A secret as it is stored."""

    @property
    def salt(self) -> str:
        """Random text, another one for each secret."""

    @property
    def digest(self) -> str:
        """The hash of salt and secret."""


S = TypeVar("S", bound=Stored)


def make_secret(size: int) -> tuple[str, str, str]:
    """A new secret of so many random bytes, its salt and its digest."""
    secret, salt = secrets.token_urlsafe(size), secrets.token_hex(16)
    return secret, salt, digest_of(salt, secret)


def digest_of(salt: str, secret: str) -> str:
    """The hash of a secret.  One round of SHA-256 is enough: these have 96 or 256 random bits and cannot be found by
    trial, unlike a password.  scrypt would block all clients of a Pi for a good part of a second.
    """
    return hashlib.sha256(f"{salt}:{secret}".encode()).hexdigest()


def find_stored(entries: Iterable[S], secret: str) -> S | None:
    """The entry of a secret; None for a wrong one.  The time does not depend on how many characters are right."""
    found = None
    for entry in entries:
        if hmac.compare_digest(entry.digest, digest_of(entry.salt, secret)):
            found = entry
    return found


class WrongSecrets:
    """Counts wrong secrets by address."""

    def __init__(self, first: float, longest: float, now: Callable[[], float] = time.monotonic) -> None:
        """``first``: seconds by which the first answer is delayed, each further one twice as long up to ``longest``."""
        self._first = first
        self._longest = longest
        self._now = now
        self._failed: dict[str, tuple[int, float]] = {}  # the address that failed last stands last

    def fail(self, address: str) -> float:
        """Count a wrong secret; returns the seconds by which its answer is delayed."""
        count, last = self._failed.pop(address, (0, 0.0))
        now = self._now()
        if now - last > FORGET_S:
            count = 0
        while len(self._failed) >= MAX_ADDRESSES:
            del self._failed[next(iter(self._failed))]
        self._failed[address] = count + 1, now
        return min(self._longest, self._first * 2.0 ** min(count, 30))

    def succeed(self, address: str) -> None:
        """Forget the wrong secrets of an address."""
        self._failed.pop(address, None)
