"""Who may come in from the network: tokens, and the first line of a connection, which has to hold one.

A token is made by ``urbihw access add NAME``, shown once, and kept here as a salted hash.  A client sends it in the
first line, ``token TOKEN``, inside TLS; until it is accepted there is no lobby and no banner, and nothing is read as
urbiscript.  The answer is one line, ``*** urbihw: token accepted ...`` or ``*** urbihw: token refused ...``.

A wrong token is answered late, and later each time, for the sake of the log and the processor; nobody can guess one.
A right one never waits, so a stranger (or a forgotten program with an old token) behind the same address keeps nobody
out.
"""

from __future__ import annotations

import hashlib
import hmac
import logging
import re
import secrets
from collections.abc import Collection
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from urbihw.daemon.state import alone, read_secret, write_secret
from urbihw.kernel.server.greeting import Refusal, line
from urbihw.kernel.uobject import BadConfig

log = logging.getLogger("urbihw.access")

FILE: Final = "tokens"
"""In the state folder: a line of name, date, salt and hash for each token."""
_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.@-]{0,63}")
MOST: Final = 1000
"""Tokens that a robot may have; each is looked at when one is shown."""


@dataclass(frozen=True)
class Entry:
    """A token as it is kept.

    Attributes:
        name: of who has it.
        made: the day, as ``2026-01-31``.
        salt, digest: see ``digest``.
    """

    name: str
    made: str
    salt: str
    digest: str


def digest(salt: str, token: str) -> str:
    """The hash of a token.

    One round of SHA-256 is enough: a token is 256 random bits, so there is nothing to try out, unlike a password, for
    which scrypt would take a Pi a good part of a second while everybody else waits.
    """
    return hashlib.sha256(f"{salt}:{token}".encode()).hexdigest()


class Tokens:
    """The tokens in a folder.  Read anew each time: ``urbihw access`` changes them while the daemon runs.

    All methods raise BadConfig when the file cannot be read or written, or others can read it.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._file = folder / FILE

    def entries(self) -> list[Entry]:
        """All, in the order in which they were made."""
        found = []
        for number, row in enumerate(read_secret(self._file).splitlines(), 1):
            words = row.split()
            if len(words) != 4:
                raise BadConfig(f"{self._file}: line {number} is no token: delete that line, and add its owner anew")
            found.append(Entry(*words))
        return found

    def add(self, name: str) -> str:
        """Make a token for somebody; the token, which is not kept.  Raises BadConfig for a name that has one."""
        if not _NAME.fullmatch(name):
            raise BadConfig(f"{name!r} is no name: give letters, digits and . _ @ -, at most 64, such as alice@laptop")
        token, salt = secrets.token_urlsafe(32), secrets.token_hex(16)
        with alone(self._folder):
            entries = self.entries()
            if any(entry.name == name for entry in entries):
                raise BadConfig(f"{name} has a token already; to make another one: urbihw access remove {name}")
            if len(entries) >= MOST:
                raise BadConfig(f"there are {MOST} tokens, and no room for another one: urbihw access remove NAME")
            self._write([*entries, Entry(name, datetime.now(UTC).date().isoformat(), salt, digest(salt, token))])
        return token

    def remove(self, name: str) -> None:
        """Let somebody in no more.  Raises BadConfig when there is no such name."""
        with alone(self._folder):
            entries = self.entries()
            if all(entry.name != name for entry in entries):
                there = ", ".join(entry.name for entry in entries) or "none"
                raise BadConfig(f"there is no token of {name}; there are: {there}")
            self._write([entry for entry in entries if entry.name != name])

    def _write(self, entries: list[Entry]) -> None:
        rows = (f"{entry.name} {entry.made} {entry.salt} {entry.digest}\n" for entry in entries)
        write_secret(self._file, "".join(rows))

    def holder(self, token: str) -> Entry | None:
        """Whose token this is.  How long it takes tells nothing of how much of it is right."""
        found = None
        for entry in self.entries():
            if hmac.compare_digest(entry.digest, digest(entry.salt, token)):
                found = entry
        return found


# ---------------------------------------------------------------- the first line of a connection


PATIENCE: Final = 10.0
"""Seconds within which the first line must have come."""
LONGEST: Final = 256
"""Bytes that it may have."""
FIRST_DELAY: Final = 0.5
LONGEST_DELAY: Final = 30.0
"""Seconds that the answer to the first wrong token of an address is kept back, and the most that it doubles to."""
MOST_PEERS: Final = 256
"""Addresses whose wrong tokens are counted; the one that has been quiet for longest is forgotten for a new one."""

_LINE: Final = re.compile(rb"token ([\x21-\x7e]+)[ \t]*\r?")


class Admission:
    """Lets in who has a token; ``admission.greeting`` makes the greeting of each connection."""

    def __init__(self, tokens: Tokens) -> None:
        self._tokens = tokens
        self._wrong: dict[str, int] = {}

    def greeting(self, peer: str) -> FirstLine:
        """For a connection from an address."""
        return FirstLine(self, peer)

    def admit(self, peer: str, token: str) -> Entry:
        """Whose token it is.  Raises Refusal."""
        try:
            entry = self._tokens.holder(token)
        except BadConfig as error:
            told = "token refused: the robot cannot read its tokens, its log says why"
            raise Refusal(line(told), str(error)) from error
        if entry is not None:
            self._wrong.pop(peer, None)
            return entry
        wrong = self._wrong.pop(peer, 0)
        while len(self._wrong) >= MOST_PEERS:
            del self._wrong[next(iter(self._wrong))]
        self._wrong[peer] = wrong + 1
        delay = min(FIRST_DELAY * 2 ** min(wrong, 16), LONGEST_DELAY)
        raise Refusal(line("token refused: it is wrong, or was removed; the robot makes another one: urbihw access add "
                           "NAME"), "a wrong token", delay)

    def check(self) -> None:
        """Look whether the tokens can be read.  Raises BadConfig."""
        self._tokens.entries()

    def gone(self, entries: Collection[Entry]) -> set[Entry]:
        """Which of these have been removed.  While the file cannot be read, none has."""
        if not entries:
            return set()
        try:
            return set(entries).difference(self._tokens.entries())
        except BadConfig as error:
            log.debug("tokens cannot be looked at: %s", error)
            return set()


class FirstLine:
    """The greeting of a connection that has to begin with ``token TOKEN``."""

    welcome_first = False
    patience = PATIENCE

    def __init__(self, admission: Admission, peer: str) -> None:
        self._admission = admission
        self._peer = peer
        self._held = b""
        self.answer = b""
        self.entry: Entry | None = None
        """Who it is, once let in."""

    @property
    def user(self) -> str:
        """The name, once let in."""
        return "" if self.entry is None else self.entry.name

    def take(self, data: bytes) -> bytes | None:
        """See ``Greeting``."""
        self._held += data
        first, end, rest = self._held.partition(b"\n")
        if not end and len(first) <= LONGEST:
            return None
        match = _LINE.fullmatch(first) if len(first) <= LONGEST else None
        self._held = b""
        if match is None:
            raise Refusal(line("token refused: the first line has to be: token TOKEN"), "no token in its first line")
        self.entry = self._admission.admit(self._peer, match[1].decode("ascii"))
        self.answer = line(f"token accepted: {self.entry.name}")
        return rest
