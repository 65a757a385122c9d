"""What to send for a set of wishes, computed once and without I/O: blocks to read, packets to write."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

from urbihw.buses.dynamixel import packet
from urbihw.buses.dynamixel.item import Item, Table

# Reading this many unwanted bytes in passing is cheaper than asking twice: an extra READ is 14 bytes in protocol 1.0,
# an extra answer of a sync read 11 in protocol 2.0.
_BRIDGE: Final = {1: 14, 2: 11}
_FORMATS: Final = {(1, False): "B", (2, False): "H", (4, False): "I", (1, True): "b", (2, True): "h", (4, True): "i"}


@dataclass(frozen=True)
class Block:
    """Neighbouring registers that are read together.

    Attributes:
        address, size: where.
        names: the wanted items in it, in order of address.
        layout: takes the bytes apart, unwanted ones skipped.
    """

    address: int
    size: int
    names: tuple[str, ...]
    layout: struct.Struct

    def unpack(self, data: bytes) -> dict[str, int]:
        """Return the raw value of each wanted item."""
        return dict(zip(self.names, self.layout.unpack(data), strict=True))


def read_blocks(table: Table, names: Iterable[str], protocol: int) -> tuple[Block, ...]:
    """Return the fewest blocks that hold all `names`. Raises BadValue for a name the table does not have.

    Two wanted items are read together when few bytes lie between them and none of those changes the device by being
    read (the remote control data of the AX-S1).
    """
    wanted = sorted({table.item(name) for name in names}, key=lambda item: item.address)
    shy = [item.address for item in table.items.values() if item.clears and item not in wanted]
    runs: list[list[Item]] = []
    for item in wanted:
        if runs:
            end = runs[-1][-1].end
            if item.address - end <= _BRIDGE[protocol] and not any(end <= address < item.address for address in shy):
                runs[-1].append(item)
                continue
        runs.append([item])
    return tuple(_block(run) for run in runs)


def _block(run: list[Item]) -> Block:
    layout = "<"
    position = run[0].address
    for item in run:
        layout += f"{item.address - position}x" if item.address > position else ""
        layout += _FORMATS[item.size, item.signed]
        position = item.end
    return Block(run[0].address, position - run[0].address, tuple(item.name for item in run), struct.Struct(layout))


def sync_writes(protocol: int, targets: Mapping[int, tuple[Table, Mapping[str, int]]]) -> list[bytes]:
    """Return the SYNC_WRITE packets that bring `targets` (device -> table, item -> raw) over, in sending order.

    Adjacent items of a device travel together, and all devices that change the same registers share one packet.
    Torque off goes last: an AX servo switches its torque on by itself when it is given a goal.
    Raises BadValue for a value out of range.
    """
    groups: dict[tuple[bool, int, int], dict[int, bytes]] = {}
    for device, (table, values) in targets.items():
        for off, address, data in _runs(table, values):
            groups.setdefault((off, address, len(data)), {})[device] = data
    packets = []
    for (_, address, size), values_of in sorted(groups.items()):
        room = (packet.MAX_PACKET_1 - 8) // (size + 1) if protocol == 1 else len(values_of)
        rows = list(values_of.items())
        for start in range(0, len(rows), room):
            packets.append(packet.sync_write_packet(protocol, address, dict(rows[start : start + room])))
    return packets


def _runs(table: Table, values: Mapping[str, int]) -> list[tuple[bool, int, bytes]]:
    """Adjacent items of one device joined: (is torque off, address, data)."""
    runs: list[tuple[bool, int, bytes]] = []
    for item in sorted((table.item(name) for name in values), key=lambda item: item.address):
        raw = values[item.name]
        off = item.name == "torque_enable" and not raw
        data = item.pack(raw)
        if runs and not off and not runs[-1][0] and runs[-1][1] + len(runs[-1][2]) == item.address:
            _, address, before = runs.pop()
            runs.append((False, address, before + data))
        else:
            runs.append((off, item.address, data))
    return runs
