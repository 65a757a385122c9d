"""The credentials of a client: the files of trusted fingerprints and of tokens.

Trust on first use, as with ssh: the user confirms the certificate of a new server, its fingerprint is stored in
``~/.config/urbihw/known_hosts`` (or below ``XDG_CONFIG_HOME``), and any other certificate is refused from then on.
Certificate authorities and dates are not checked: a robot makes its certificate itself, maybe before its clock is set.

A token comes from the given file, from ``URBIHW_TOKEN``, or from a line ``HOST TOKEN`` or ``HOST:PORT TOKEN`` of
``~/.config/urbihw/tokens``; otherwise the user is asked for it.
"""

from __future__ import annotations

import hashlib
import os
import re
import stat
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final, NamedTuple

from urbihw.client.where import Where

_TOKEN: Final = re.compile(r"[\x21-\x7e]{1,200}")
_FINGERPRINT: Final = "(the robot prints it: urbihw access fingerprint)"


class Denied(Exception):
    """The client does not trust the server, or the server refuses the client: to try again would not help.

    The message is one line that tells what to do.
    """


def fingerprint(certificate: bytes) -> str:
    """The SHA-256 of a certificate in DER, as ``openssl x509 -fingerprint -sha256`` writes it."""
    return hashlib.sha256(certificate).digest().hex(":").upper()


class Words(NamedTuple):
    """How the user says what a message asks for: by options of a command, or by arguments of a function."""

    tls: str
    no_tls: str
    trust: str
    token_file: str


OPTIONS: Final = Words("--tls", "--no-tls", "--trust", "--token-file FILE")
ARGUMENTS: Final = Words("tls=True", "tls=False", "trust=True", "token_file=FILE")


class Credentials:
    """The credentials of the user, for one or several connections."""

    def __init__(
        self,
        token_file: Path | None = None,
        trust: bool = False,
        confirm: Callable[[str], bool] | None = None,
        ask: Callable[[str], str] | None = None,
        environment: Mapping[str, str] = os.environ,
        words: Words = OPTIONS,
    ) -> None:
        """``trust``: accept the certificate of an unknown server without a question.  ``confirm`` asks a yes-or-no
        question, ``ask`` asks for a secret; None when there is no terminal.  ``words``: those of messages."""
        self.words = words
        self._token_file = token_file
        self._trust = trust
        self._confirm = confirm
        self._ask = ask
        self._environment = environment
        self._asked: dict[str, str] = {}

    @property
    def folder(self) -> Path:
        """The folder of the files."""
        home = self._environment.get("XDG_CONFIG_HOME") or os.path.join(self._environment.get("HOME", "~"), ".config")
        return Path(home).expanduser() / "urbihw"

    # ---------------------------------------------------------------- the server

    def check_certificate(self, where: Where, certificate: bytes) -> None:
        """Compare a certificate with the stored fingerprint.  The fingerprint of an unknown server is stored if it is
        trusted.

        Raises Denied.
        """
        shown, file = fingerprint(certificate), self.folder / "known_hosts"
        for number, (known, pin) in enumerate(_pairs(file), 1):
            if known != str(where).lower():
                continue
            if pin.upper() == shown:
                return
            raise Denied(f"the certificate of {where} is another one than before, {shown}: somebody may be in between; "
                         f"if that is its new one {_FINGERPRINT}, delete line {number} of {file}")
        if not self._trust and not (self._confirm is not None and self._confirm(
            f"{where} is not known yet. The fingerprint of its certificate {_FINGERPRINT} is\n  {shown}\nTrust it?"
        )):
            raise Denied(f"{where} is not known yet; its fingerprint is {shown} {_FINGERPRINT}: "
                         f"{self.words.trust} trusts it from now on")
        _append(file, f"{str(where).lower()} {shown}\n")

    # ---------------------------------------------------------------- the user

    def token(self, where: Where) -> str:
        """The token for a server.  Raises Denied when there is none."""
        found = self._given() or self._kept(where) or self._asked.get(str(where), "")
        if not found and self._ask is not None:
            found = self._asked[str(where)] = self._ask(f"token for {where}: ").strip()
        if not found:
            raise Denied(f"{where} wants a token (the robot makes one: urbihw access add NAME): "
                         f"give {self.words.token_file}, URBIHW_TOKEN, "
                         f"or a line '{where} TOKEN' in {self.folder / 'tokens'}")
        if not _TOKEN.fullmatch(found):
            raise Denied(f"the token for {where} is invalid: it is one word of letters, digits, - and _")
        return found

    def forget_token(self, where: Where) -> None:
        """Discard a typed token that the server has refused."""
        self._asked.pop(str(where), None)

    def _given(self) -> str:
        if self._token_file is None:
            return self._environment.get("URBIHW_TOKEN", "").strip()
        return _private(self._token_file, needed=True).strip()

    def _kept(self, where: Where) -> str:
        names = (str(where).lower(), where.host.lower())
        found = {name: token for name, token in _pairs(self.folder / "tokens", private=True) if name in names}
        return next((found[name] for name in names if name in found), "")


def _pairs(file: Path, private: bool = False) -> list[tuple[str, str]]:
    """The first two words of each line, the first in lower case; ("", "") for a line without two words."""
    lines = (_private(file) if private else _text(file)).splitlines()
    return [(words[0].lower(), words[1]) if len(words) > 1 else ("", "") for words in (line.split() for line in lines)]


def _text(file: Path, needed: bool = False) -> str:
    try:
        return file.read_text("utf-8", "replace")
    except OSError as error:
        if isinstance(error, FileNotFoundError) and not needed:
            return ""
        raise Denied(f"cannot read {file}: {error.strerror}") from error


def _private(file: Path, needed: bool = False) -> str:
    """The text of a file with tokens.  Raises Denied if other users can read it."""
    text = _text(file, needed)
    if file.is_file() and stat.S_IMODE(file.stat().st_mode) & 0o077:
        raise Denied(f"{file} holds tokens and can be read by others: chmod 600 {file}")
    return text


def _append(file: Path, line: str) -> None:
    try:
        file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with open(os.open(file, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600), "a", encoding="utf-8") as opened:
            opened.write(line)
    except OSError as error:
        raise Denied(f"cannot write {file}, where known servers are kept: {error.strerror}") from error
