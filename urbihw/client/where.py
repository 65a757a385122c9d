"""The address of a server, and the transport to reach it."""

from __future__ import annotations

import ipaddress
import os
from pathlib import Path
from typing import Final

from urbihw.frozen import frozen
from urbihw.started import as_typed

DEFAULT_HOST: Final = "127.0.0.1"


@frozen(slots=False)
class Where:
    """The address of a server.

    Attributes:
        host: its name or address, or, with a ``/`` in it, the path of its UNIX socket.
        port: its TCP port.
        tls: whether to use TLS, with a token.
    """

    host: str
    port: int
    tls: bool = False

    @property
    def path(self) -> Path | None:
        """The path of the UNIX socket; None for TCP."""
        return Path(self.host) if "/" in self.host else None

    def __str__(self) -> str:
        """The address as users write it."""
        if self.path is not None:
            return self.path.stem
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"


def where_is(host: str, port: int, tls: bool | None = None) -> Where:
    """The address of a server.  ``tls`` None means the default: TLS to other machines, none to this one."""
    return Where(host, port, "/" not in host and (not is_loopback(host) if tls is None else tls))


def why(error: Exception) -> str:
    """The reason why a host or port is not available, in a few words.  An impossible host name is a UnicodeError."""
    if isinstance(error, TimeoutError):
        return "no answer"
    if isinstance(error, UnicodeError):
        return "this is no name of a host"
    number = getattr(error, "errno", None)
    return os.strerror(number) if number and number > 0 else getattr(error, "strerror", None) or str(error)


def explain_absence(where: Where, error: OSError | UnicodeError) -> str:
    """The sentence for a server that cannot be reached."""
    if where.path is not None and isinstance(error, FileNotFoundError | ConnectionRefusedError):
        left = " any more, and the file may go" if where.path.exists() else ""
        return f"no server listens at {where.path}{left}; start the server: {as_typed('urbihw serve')}"
    return f"cannot connect to {where}: {why(error)}; is the server running, is this its port?"


def is_loopback(host: str) -> bool:
    """Whether a host is this machine, by its address or by the name ``localhost``; other names are not looked up."""
    if host.rstrip(".").lower() in ("localhost", "ip6-localhost"):
        return True
    try:
        return ipaddress.ip_address(host.partition("%")[0]).is_loopback
    except ValueError:
        return False
