"""Planning of transactions, without I/O: blocks of registers to read, packets to write."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping, Sequence
from typing import Final

from urbihw.buses.servos import packet
from urbihw.buses.servos.item import ControlTable, Item, magnitude_of, number_of
from urbihw.buses.servos.status import FEETECH
from urbihw.frozen import frozen

# Up to this many unwanted bytes it is cheaper to read through them than to ask twice: an extra READ is 14 bytes in
# protocol 1.0, an extra answer of a sync read 11 in protocol 2.0.
_BRIDGE: Final = {1: 14, 2: 11, FEETECH: 14}
_MAX_SENT_2: Final = 1024
"""Bytes of a packet of protocol 2.0 that dynamixel-sdk sends at most; the protocol itself has room for 65542."""
TORQUE: Final = "torque_enable"
_FORMATS: Final = {(1, False): "B", (2, False): "H", (4, False): "I", (1, True): "b", (2, True): "h", (4, True): "i"}


@frozen(slots=False)
class Block:
    """Neighbouring registers that are read, or written, together.

    Attributes:
        address, size: where.
        names: the wanted items in it, in order of address.
        layout: packs and unpacks the bytes, unwanted ones skipped.
        signs: (item, bit of the sign) of those that are sign and magnitude.
    """

    address: int
    size: int
    names: tuple[str, ...]
    layout: struct.Struct
    signs: tuple[tuple[str, int], ...] = ()

    def unpack(self, data: bytes) -> dict[str, int]:
        """Return the raw value of each wanted item."""
        values = dict(zip(self.names, self.layout.unpack(data), strict=True))
        for name, bit in self.signs:
            values[name] = number_of(values[name], bit)
        return values

    def pack(self, values: Mapping[str, int]) -> bytes:
        """Return the bytes of the items, whose values must be in range."""
        if self.signs:
            values = {**values, **{name: magnitude_of(values[name], bit) for name, bit in self.signs}}
        return self.layout.pack(*[values[name] for name in self.names])


def read_blocks(table: ControlTable, names: Iterable[str], protocol: int) -> tuple[Block, ...]:
    """Return the fewest blocks that hold all `names`. Raises BadValue for a name the table does not have.

    Two wanted items are read together when few bytes lie between them and none of those changes the device by being
    read (the remote control data of the AX-S1).
    """
    wanted = sorted({table.item(name) for name in names}, key=lambda item: item.address)
    clears_on_read = [item.address for item in table.items.values() if item.clears_on_read and item not in wanted]
    runs: list[list[Item]] = []
    for item in wanted:
        if runs:
            end = runs[-1][-1].end
            clears = any(end <= address < item.address for address in clears_on_read)
            if item.address - end <= _BRIDGE[protocol] and not clears:
                runs[-1].append(item)
                continue
        runs.append([item])
    return tuple(_block(run) for run in runs)


def _block(run: list[Item]) -> Block:
    layout = ">" if run[0].big_endian else "<"
    position = run[0].address
    for item in run:
        layout += f"{item.address - position}x" if item.address > position else ""
        layout += _FORMATS[item.size, item.signed]
        position = item.end
    names = tuple(item.name for item in run)
    signs = tuple((item.name, item.sign_bit) for item in run if item.sign_bit is not None)
    return Block(run[0].address, position - run[0].address, names, struct.Struct(layout), signs)


# Blocks without gaps, and the devices that change exactly their items: (device, item -> raw).
WriteGroup = tuple[tuple[Block, ...], Sequence[tuple[int, Mapping[str, int]]]]


def write_runs(table: ControlTable, names: Iterable[str]) -> tuple[Block, ...]:
    """Return the fewest blocks without gaps that hold all `names`; torque enable has its own, for `sync_writes`."""
    runs: list[list[Item]] = []
    for item in sorted((table.item(name) for name in names), key=lambda item: item.address):
        alone = not runs or TORQUE in {item.name, runs[-1][-1].name} or runs[-1][-1].end != item.address
        if alone:
            runs.append([item])
        else:
            runs[-1].append(item)
    return tuple(map(_block, runs))


def _rows_in_a_packet(protocol: int, size: int) -> int:
    """Return for how many devices a SYNC_WRITE of `size` bytes each has room."""
    if protocol != 2:
        return (packet.MAX_PACKET_1 - 8) // (size + 1)
    # Stuffing adds a byte to three at most.
    return (_MAX_SENT_2 - 14) * 3 // 4 // (size + 1)


def sync_writes(protocol: int, groups: Iterable[WriteGroup]) -> list[bytes]:
    """Return the SYNC_WRITE packets for groups of devices that change the same items, in sending order.

    All devices that change the same registers share one packet. Torque off goes last: an AX servo switches its torque
    on by itself when it is given a goal. The values must be in range.
    """
    rows: dict[tuple[bool, int, int], dict[int, bytes]] = {}
    for runs, devices in groups:
        for run in runs:
            pack, place = run.pack, (run.address, run.size)
            if run.names[0] == TORQUE:
                for device, values in devices:
                    rows.setdefault((not values[TORQUE], *place), {})[device] = pack(values)
            else:
                row = rows.setdefault((False, *place), {})
                for device, values in devices:
                    row[device] = pack(values)
    packets = []
    for (_, address, size), row in sorted(rows.items()):
        room = _rows_in_a_packet(protocol, size)
        if len(row) <= room:
            packets.append(packet.sync_write_packet(protocol, address, row))
            continue
        items = list(row.items())
        for start in range(0, len(items), room):
            packets.append(packet.sync_write_packet(protocol, address, dict(items[start : start + room])))
    return packets
