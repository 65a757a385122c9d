"""Logging in: credentials, and the sentence for each way in which a login fails.

libqi's documentation and that of qiloop name the keys of the credentials and the token that a robot without a password
hands out at the first login.  No robot with NAOqi 2.9 has confirmed either, so both are settings.
"""

from __future__ import annotations

import contextlib
import errno
import os
import stat
from dataclasses import field
from typing import Any, Final

from urbihw.buses.errors import Unavailable
from urbihw.frozen import frozen

AUTH_STATE: Final = "__qi_auth_state"
AUTH_ERROR, AUTH_CONTINUE, AUTH_DONE = 1, 2, 3
NEW_TOKEN: Final = "auth_newToken"
"""What a robot that has no password yet hands out, once."""
REFUSED: Final = "the robot refuses user or password: options.user, options.password"
LONGEST_TOKEN: Final = 256
TLS_ALERT, TLS_HANDSHAKE = 0x15, 0x16


@frozen(slots=False)
class Login:
    """Who logs in.

    Attributes:
        user, token: "" for a robot without a login.
        user_key, token_key: under which names the two are sent.
        token_file: where a token is kept that the robot hands out; "" to accept none.  Once there, it replaces
            ``token``.
        other_hosts: whether to log in at end points of other hosts, if the robot's directory names some.
    """

    user: str = ""
    token: str = field(default="", repr=False)
    user_key: str = "auth_user"
    token_key: str = "auth_token"
    token_file: str = ""
    other_hosts: bool = False

    def current_token(self) -> str:
        """The token in use: that of the file, if the file is there.  Raises Unavailable if it cannot be read."""
        if not self.token_file:
            return self.token
        try:
            found = _read_file(self.token_file).strip()
        except FileNotFoundError:
            return self.token
        except OSError as error:
            why = "it is a link" if error.errno == errno.ELOOP else error.strerror
            raise Unavailable(errno.EACCES, f"options.token_file: {self.token_file} cannot be read: {why}") from error
        if not _is_token(found):
            text = f"options.token_file: {self.token_file} has no token: 1 to {LONGEST_TOKEN} printable characters"
            raise Unavailable(errno.EACCES, text)
        return found

    def words(self) -> dict[str, Any]:
        """The credentials as they are sent; none for a robot without a login.  Raises Unavailable."""
        token = self.current_token()
        return {self.user_key: self.user, self.token_key: token} if self.user or token else {}

    def keep_token(self, where: str, token: str) -> None:
        """Write a new token to its file, readable for this user only.  Raises Unavailable.

        The robot knows no other way in afterwards, so it is written before it is used.  A password or token that is
        there already is kept: the one that is lost would be that of our robot, for one of a stranger.
        """
        if not self.token_file:
            raise Unavailable(
                errno.EACCES,
                f"{where}: the robot has no password yet and hands out a token, which must be kept: set "
                "options.token_file, or a password on the robot's own page",
            )
        if self.current_token():
            kept = "delete the file" if self.current_token() != self.token else "remove options.password"
            text = f"{where}: {REFUSED}; it hands out a new token, which is not taken: if the robot was reset, {kept}"
            raise Unavailable(errno.EACCES, text)
        if not _is_token(token):
            text = f"{where}: the robot hands out an invalid token: 1 to {LONGEST_TOKEN} printable characters"
            raise Unavailable(errno.EACCES, text)
        fresh = f"{self.token_file}.new"
        try:
            with contextlib.suppress(FileNotFoundError):
                os.unlink(fresh)
            with open(os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="utf-8") as file:
                file.write(token + "\n")
            # Unlike a renaming, this replaces nothing.
            os.link(fresh, self.token_file)
            os.unlink(fresh)
        except OSError as error:
            why = f"which cannot be written to {self.token_file}: {error.strerror}"
            raise Unavailable(errno.EACCES, f"{where}: the robot hands out a token, {why}") from error


def _read_file(path: str) -> str:
    """The beginning of a file that is one, and no link.  Raises OSError."""
    with open(os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC), "rb") as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise OSError(errno.EINVAL, "it is no file")
        return file.read(2 * LONGEST_TOKEN).decode("latin-1")


def _is_token(text: str) -> bool:
    return 0 < len(text) <= LONGEST_TOKEN and text.isascii() and text.isprintable() and " " not in text


def describe_stranger(where: str, data: bytes) -> str:
    """The sentence for a server that answers something else than QiMessaging."""
    head = data[:64].lstrip()
    if head.startswith((b"HTTP/", b"<")):
        return (
            f"{where} answers in HTTP: this is NAOqi 1, which does not speak QiMessaging; put NAOqi 2.1 on the robot, "
            "which all Nao from version 3.3 on can have"
        )
    if data[:1] in (bytes([TLS_ALERT]), bytes([TLS_HANDSHAKE])) and data[1:2] == b"\x03":
        return f"{where} speaks TLS: write qis:// instead of qi://"
    return f"{where}: what answers there is no NAOqi 2"


def describe_silence(where: str, seconds: float) -> str:
    """The sentence for a server that accepts a connection and says nothing."""
    return (
        f"{where}: connected, but no answer to the login in {seconds:g} s; NAOqi may still be starting, or this is no "
        "NAOqi 2"
    )


def describe_hang_up(where: str) -> str:
    """The sentence for a server that hangs up at the login."""
    return (
        f"{where}: the other side hangs up at the login; NAOqi 1 does so, which needs NAOqi 2.1, and NAOqi 2.9 where "
        "the url must be qis://"
    )


def describe_closed_port(host: str, port: int, reason: str) -> str:
    """The sentence for a closed port, or a host that is not there."""
    return (
        f"cannot connect to {host}:{port} ({reason}); is the robot on, and has NAOqi started? NAOqi 2.9 listens for "
        f"qis://{host} only"
    )
