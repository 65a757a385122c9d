"""Authentication of clients from the network: tokens, and the first line of a connection, which must contain one.

A token is made by ``urbihw access add NAME``, shown once, and stored as a salted hash.  A client sends it in the first
line, ``token TOKEN``, inside TLS; until it is accepted there is no lobby and no banner, and nothing is read as
urbiscript.  The answer is one line, ``*** urbihw: token accepted ...`` or ``*** urbihw: token refused ...``.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Collection
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from urbihw.daemon.files import read_regular
from urbihw.daemon.secrets import NAME, NAME_RULE, WrongSecrets, find_stored, make_secret
from urbihw.daemon.state import MAX_SECRET_BYTES, lock_folder, read_secret, write_secret
from urbihw.frozen import frozen
from urbihw.kernel.server.handshake import HandshakeRefusal, line
from urbihw.kernel.uobject import BadConfig
from urbihw.started import as_typed

log = logging.getLogger("urbihw.access")

FILE: Final = "tokens"
"""Name of the file in the state folder, with a line of name, date, salt and hash for each token."""
CREDENTIAL: Final = "urbihw.tokens"
"""Name of the same file as a credential of the service manager."""
MAX_TOKENS: Final = 1000
"""Maximum number of tokens of a robot; all are compared at each login."""


@frozen(slots=False)
class StoredToken:
    """A stored token.

    Attributes:
        name: name of the owner.
        made: day of creation, as ``2026-01-31``.
        salt, digest: the salt, and the hash of salt and token (``secrets.digest_of``).
    """

    name: str
    made: str
    salt: str
    digest: str


class Tokens:
    """The tokens in a folder.  The file is read at each call: ``urbihw access`` changes it while the daemon runs.

    All methods raise BadConfig if the file cannot be read or written, or if other users can read it.
    """

    def __init__(self, folder: Path, passed: Path | None = None) -> None:
        """``passed``: a file of the service manager with the tokens, which is read instead of that of the folder."""
        self._folder = folder
        self._file = folder / FILE
        self._passed = passed

    def entries(self) -> list[StoredToken]:
        """All tokens, in the order of their creation."""
        found = []
        for number, row in enumerate(self._text().splitlines(), 1):
            words = row.split()
            if len(words) != 4:
                file = self._passed or self._file
                raise BadConfig(f"{file}: line {number} is no token: delete that line, and add its owner anew")
            found.append(StoredToken(*words))
        return found

    def _text(self) -> str:
        if self._passed is None:
            return read_secret(self._file)
        return read_regular(self._passed, MAX_SECRET_BYTES).data.decode("utf-8", "replace")

    def add(self, name: str) -> str:
        """Make a token for a new name, and return it; only its hash is stored.  Raises BadConfig for a name that has
        one."""
        if not NAME.fullmatch(name):
            raise BadConfig(f"{name!r} is no name: {NAME_RULE} alice@laptop")
        token, salt, digest = make_secret(32)
        with lock_folder(self._folder):
            entries = self.entries()
            if any(entry.name == name for entry in entries):
                removing = as_typed("urbihw access remove")
                raise BadConfig(f"{name} has a token already; to make another one: {removing} {name}")
            if len(entries) >= MAX_TOKENS:
                removing = as_typed("urbihw access remove")
                raise BadConfig(f"there are {MAX_TOKENS} tokens, which is the most: {removing} NAME")
            self._write([*entries, StoredToken(name, datetime.now(UTC).date().isoformat(), salt, digest)])
        return token

    def remove(self, name: str) -> None:
        """Remove the token of a name.  Raises BadConfig when there is no such name."""
        with lock_folder(self._folder):
            entries = self.entries()
            if all(entry.name != name for entry in entries):
                there = ", ".join(entry.name for entry in entries) or "none"
                raise BadConfig(f"there is no token of {name}; there are: {there}")
            self._write([entry for entry in entries if entry.name != name])

    def _write(self, entries: list[StoredToken]) -> None:
        rows = (f"{entry.name} {entry.made} {entry.salt} {entry.digest}\n" for entry in entries)
        write_secret(self._file, "".join(rows))

    def find_entry(self, token: str) -> StoredToken | None:
        """The entry of a token; None for a wrong one."""
        return find_stored(self.entries(), token)


# ---------------------------------------------------------------- the first line of a connection


FIRST_LINE_TIMEOUT_S: Final = 10.0
"""Seconds within which the first line must arrive."""
MAX_FIRST_LINE: Final = 256
"""Maximum length of the first line in bytes."""
FIRST_DELAY_S: Final = 0.5
MAX_DELAY_S: Final = 30.0
"""Seconds by which the answer to the first wrong token of an address is delayed, and the maximum of the doubled
delay."""

_LINE: Final = re.compile(rb"token ([\x21-\x7e]+)[ \t]*\r?")


class Authenticator:
    """Accepts clients with a valid token; ``authenticator.handshake`` makes the handshake of each connection."""

    def __init__(self, tokens: Tokens) -> None:
        self._tokens = tokens
        self._wrong = WrongSecrets(FIRST_DELAY_S, MAX_DELAY_S)

    def handshake(self, peer: str) -> TokenHandshake:
        """Make the handshake of a connection from an address."""
        return TokenHandshake(self, peer)

    def authenticate(self, peer: str, token: str) -> StoredToken:
        """The entry of a token.  Raises HandshakeRefusal for a wrong one."""
        try:
            entry = self._tokens.find_entry(token)
        except BadConfig as error:
            told = "token refused: the robot cannot read its tokens, its log says why"
            raise HandshakeRefusal(line(told), str(error)) from error
        if entry is not None:
            self._wrong.succeed(peer)
            return entry
        raise HandshakeRefusal(
            line("token refused: it is wrong, or was removed; the robot makes another one: urbihw access add NAME"),
            "a wrong token",
            self._wrong.fail(peer),
        )

    def check(self) -> None:
        """Check that the tokens can be read.  Raises BadConfig."""
        self._tokens.entries()

    def removed_entries(self, entries: Collection[StoredToken]) -> set[StoredToken]:
        """The removed ones of some entries; none while the file cannot be read."""
        if not entries:
            return set()
        try:
            return set(entries).difference(self._tokens.entries())
        except BadConfig as error:
            log.debug("tokens cannot be looked at: %s", error)
            return set()


class TokenHandshake:
    """The handshake of a connection that must begin with ``token TOKEN``."""

    welcome_first = False
    timeout = FIRST_LINE_TIMEOUT_S

    def __init__(self, authenticator: Authenticator, peer: str) -> None:
        self._admission = authenticator
        self._peer = peer
        self._held = b""
        self.answer = b""
        self.entry: StoredToken | None = None
        """The entry of the client's token, once it is accepted."""

    @property
    def user(self) -> str:
        """The name of the client, once it is accepted; "" before."""
        return "" if self.entry is None else self.entry.name

    def check_bytes(self, data: bytes) -> bytes | None:
        """The bytes behind the first line, if that contains a valid token; None until it is complete.  Raises
        HandshakeRefusal."""
        self._held += data
        first, end, rest = self._held.partition(b"\n")
        if not end and len(first) <= MAX_FIRST_LINE:
            return None
        match = _LINE.fullmatch(first) if len(first) <= MAX_FIRST_LINE else None
        self._held = b""
        if match is None:
            raise HandshakeRefusal(
                line("token refused: the first line has to be: token TOKEN"), "no token in its first line"
            )
        self.entry = self._admission.authenticate(self._peer, match[1].decode("ascii"))
        self.answer = line(f"token accepted: {self.entry.name}")
        return rest
