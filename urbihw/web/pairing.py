"""The browsers that may come in: one-time codes, and the cookies of paired browsers.

A code is good once, for two minutes; the browser that presents it gets a cookie for 30 days.  Only
salted hashes of codes and cookies are kept, in the folder of the tokens.  The files are read at each use: ``urbihw
panel pair`` and ``remove`` change them while the gateway runs.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final, Literal, NamedTuple, TypeGuard

from urbihw.daemon.secrets import NAME, NAME_RULE, find_stored, make_secret
from urbihw.daemon.state import lock_folder, read_secret, write_secret
from urbihw.frozen import frozen

Role = Literal["view", "drive", "full"]
ROLES: Final[tuple[Role, ...]] = ("view", "drive", "full")
CODE_LIFETIME_S: Final = 120.0
COOKIE_DAYS: Final = 30
MAX_BROWSERS: Final = 64
"""Browsers that are kept for each port; the oldest makes room for one more."""
MAX_CODES: Final = 16
FILE: Final = "browsers"
CODES: Final = "browser-codes"


class BadPairing(ValueError):
    """A pairing cannot be made or removed; the message is one line that tells what to do."""


@frozen(slots=False)
class Browser:
    """A paired browser.

    Attributes:
        name: the name given at the pairing.
        role: what it may do.
        port: port of the gateway for which it is paired.
        made: day of the pairing, as ``2026-01-31``.
        salt, digest: salt, and hash of salt and cookie.
    """

    name: str
    role: Role
    port: int
    made: str
    salt: str
    digest: str

    @property
    def is_expired(self) -> bool:
        """Whether its cookie is too old."""
        return datetime.now(UTC).date() > datetime.fromisoformat(self.made).date() + timedelta(days=COOKIE_DAYS)


class _Code(NamedTuple):
    name: str
    role: Role
    port: int
    ends: float
    salt: str
    digest: str


class Pairings:
    """The codes and browsers in a folder.  All methods raise BadConfig when its files cannot be used."""

    def __init__(self, folder: Path, now: Callable[[], float] = time.time) -> None:
        self._folder = folder
        self._now = now

    # ---------------------------------------------------------------- codes

    def make_code(self, name: str, role: str, port: int) -> str:
        """A code for a browser of this name and role at the gateway on a port.  Raises BadPairing for a bad name."""
        if not NAME.fullmatch(name):
            raise BadPairing(f"{name!r} is no name: {NAME_RULE} anna")
        if not is_role(role):
            raise BadPairing(f"{role!r} is no role: give {', '.join(ROLES)}")
        code, salt, digest = make_secret(12)
        made = _Code(name, role, port, self._now() + CODE_LIFETIME_S, salt, digest)
        with lock_folder(self._folder):
            self._write_codes([*self._codes(), made][-MAX_CODES:])
        return code

    def redeem(self, code: str, port: int) -> tuple[Browser, str] | None:
        """The browser that a code admits, and its cookie; None for a wrong, used or old code."""
        if _find_code(self._codes(), code, port) is None:
            return None  # wrong codes neither wait for the lock nor hold it
        with lock_folder(self._folder):
            codes = self._codes()
            found = _find_code(codes, code, port)
            if found is None:
                return None
            self._write_codes([each for each in codes if each is not found])
            cookie, salt, digest = make_secret(32)
            today = datetime.now(UTC).date().isoformat()
            browser = Browser(found.name, found.role, port, today, salt, digest)
            self._write([*self._fresh(port), browser])
        return browser, cookie

    def _codes(self) -> list[_Code]:
        """The codes that are still good."""
        rows = (row.split() for row in read_secret(self._folder / CODES).splitlines())
        found = [
            _Code(row[0], row[1], int(row[2]), float(row[3]), row[4], row[5])
            for row in rows
            if len(row) == 6 and is_role(row[1])
        ]
        # A code of the future is one from before the clock was set.
        return [each for each in found if 0 <= each.ends - self._now() <= CODE_LIFETIME_S]

    def _write_codes(self, codes: list[_Code]) -> None:
        rows = (f"{' '.join(map(str, each))}\n" for each in codes)
        write_secret(self._folder / CODES, "".join(rows))

    # ---------------------------------------------------------------- browsers

    def browsers(self) -> list[Browser]:
        """All paired browsers, in the order of their pairing."""
        found = []
        for row in read_secret(self._folder / FILE).splitlines():
            words = row.split()
            if len(words) == 6 and is_role(words[1]) and words[2].isdigit():
                browser = Browser(words[0], words[1], int(words[2]), words[3], words[4], words[5])
                if not browser.is_expired:
                    found.append(browser)
        return found

    def find(self, cookie: str, port: int) -> Browser | None:
        """The browser with a cookie; None for a wrong or old one."""
        return find_stored((each for each in self.browsers() if each.port == port), cookie)

    def remove(self, name: str) -> int:
        """Remove the browsers of a name; returns how many there were.  Raises BadPairing if there are none."""
        with lock_folder(self._folder):
            known = self.browsers()
            kept = [each for each in known if each.name != name]
            if len(kept) == len(known):
                there = ", ".join(dict.fromkeys(each.name for each in known)) or "none"
                raise BadPairing(f"there is no browser of {name}; there are: {there}")
            self._write(kept)
        return len(known) - len(kept)

    def _fresh(self, port: int) -> list[Browser]:
        """The browsers that are kept when one more comes for a port."""
        known = self.browsers()
        here = [each for each in known if each.port == port]
        dropped = here[: max(0, len(here) - MAX_BROWSERS + 1)]
        return [each for each in known if each not in dropped]

    def _write(self, browsers: list[Browser]) -> None:
        rows = (
            f"{each.name} {each.role} {each.port} {each.made} {each.salt} {each.digest}\n" for each in browsers
        )  # fmt: skip
        write_secret(self._folder / FILE, "".join(rows))


def _find_code(codes: list[_Code], code: str, port: int) -> _Code | None:
    return find_stored((each for each in codes if each.port == port), code)


def is_role(text: str) -> TypeGuard[Role]:
    """Whether a text is the name of a role."""
    return text in ROLES
