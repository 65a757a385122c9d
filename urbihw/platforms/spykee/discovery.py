"""The search for Spykees: a question by UDP on all interfaces, and the answers (fact sheet, section 2)."""

from __future__ import annotations

import fcntl
import select
import socket
import struct
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final

from urbihw.frozen import frozen
from urbihw.platforms.spykee import protocol as p
from urbihw.settings import one_line

SEARCH_TIMEOUT_S: Final = 1.5
"""Seconds to wait for answers."""
QUESTION_PERIOD_S: Final = 0.5
"""Seconds between two questions: a datagram may be lost."""
_EVERYBODY: Final = "255.255.255.255"
_INTERFACES: Final = Path("/sys/class/net")
_SIOCGIFBRDADDR: Final = 0x8919
_LOOPBACK_BROADCAST: Final = "127.255.255.255"
"""A simulated robot on this machine; the interface lo has no broadcast address of its own."""


@frozen
class FoundRobot:
    """A robot that has answered.

    Attributes:
        address: of its control port, ``host:port``.
        uid: its identifier.
        user: who is connected to it, "" without one.
    """

    address: str
    uid: str
    user: str

    def __str__(self) -> str:
        return f"spykee://{self.address}  {self.uid}" + (f", in use by {self.user}" if self.user else "")


def broadcast_addresses() -> list[str]:
    """The broadcast addresses of all interfaces that have one, and the general one."""
    found = [_LOOPBACK_BROADCAST]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        # Not if_nameindex, which needs a netlink socket: the unit of the service allows none.
        names = sorted(path.name for path in _INTERFACES.iterdir()) if _INTERFACES.is_dir() else []
        for name in names:
            try:
                row = fcntl.ioctl(probe, _SIOCGIFBRDADDR, struct.pack("256s", name.encode()[:15]))
            except OSError:
                continue  # an interface without an IPv4 address, or one between two machines
            found.append(socket.inet_ntoa(row[20:24]))
    return [address for address in dict.fromkeys([*found, _EVERYBODY]) if address != "0.0.0.0"]


def search(
    port: int = p.PORT, seconds: float = SEARCH_TIMEOUT_S, addresses: Iterable[str] = ()
) -> Iterator[FoundRobot]:
    """Ask for ``seconds`` at these addresses, or on all interfaces; each robot once, as it answers.

    Raises OSError when there is no network at all.
    """
    where = list(addresses) or broadcast_addresses()
    seen = set()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asker:
        asker.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        asker.bind(("", 0))
        asker.setblocking(False)
        end = time.monotonic() + seconds
        ask_at = 0.0
        while (now := time.monotonic()) < end:
            if now >= ask_at:
                ask_at = now + QUESTION_PERIOD_S
                _ask(asker, where, port)
            if not select.select((asker,), (), (), max(0.0, min(end, ask_at) - now))[0]:
                continue
            try:
                data, (host, _) = asker.recvfrom(2048)
            except OSError:
                continue  # "connection refused": no robot at one of the addresses
            fields = p.read_discovery(data)
            if fields is not None and host not in seen:
                seen.add(host)
                uid, user = (one_line(fields.get(key, "")) for key in ("uid", "connected-user"))
                yield FoundRobot(f"{host}:{port}", uid, user)


def _ask(asker: socket.socket, where: Iterable[str], port: int) -> None:
    """Send the question to all addresses.  Raises OSError only if all fail."""
    problem: OSError | None = None
    sent = False
    for address in where:
        try:
            asker.sendto(p.QUESTION, (address, port))
            sent = True
        except OSError as error:
            problem = error
    if not sent and problem is not None:
        raise problem


def scan() -> Iterator[FoundRobot]:
    """The robots in reach, for ``urbihw scan spykee``.  Raises OSError when there is no network."""
    return search()
