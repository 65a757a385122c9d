"""Recorded or documented traffic, as `.hex` files, and the one way to read them.

    # source, date, firmware ...            a comment
    [p1-ping]  Ping ID 1                    a name, and what it shows
    > FF FF 01 02 01 FB                     host to device
    < FF FF 01 02 00 FC                     device to host; none: not answered, or nothing written down

These files are the independent witness between a driver and its fake: neither is changed to fit the other, both have
to fit the file.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from urbihw_fakes.errors import UnknownRequest


@dataclass(frozen=True, slots=True)
class Exchange:
    """One named exchange; `sent` and `received` are the packets in order."""

    name: str
    title: str
    sent: list[bytes] = field(default_factory=list)
    received: list[bytes] = field(default_factory=list)


def read(name: str) -> dict[str, Exchange]:
    """The exchanges of `<name>.hex` in this folder, by name, in the order of the file.

    Raises:
        UnknownRequest: there is no such file, or a line of it cannot be understood.
    """
    path = Path(__file__).parent / f"{name}.hex"
    if not path.is_file():
        raise UnknownRequest(f"captures {name!r}: there is no {path.name}")
    exchanges: dict[str, Exchange] = {}
    for number, line in enumerate(path.read_text(encoding="ascii").splitlines(), 1):
        if not line or line.startswith("#"):
            continue
        if line.startswith("["):
            key, _, title = line[1:].partition("]")
            exchange = exchanges[key] = Exchange(key, title.strip())
        elif line[0] in "<>" and exchanges:
            (exchange.sent if line[0] == ">" else exchange.received).append(bytes.fromhex(line[1:]))
        else:
            raise UnknownRequest(f"{path.name}, line {number}: expected '[name]', '>' or '<', found {line!r}")
    return exchanges
