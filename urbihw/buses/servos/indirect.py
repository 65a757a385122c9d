"""The indirect area of X servos: bytes of data that stand for other registers, by address entries that can be written.

A raw write there counts as a write of what it leads to: a register with a name is written by that name, so that its
range, and what it does to the robot, is known. Source: e-manual, Indirect Address and Indirect Data.
"""

from __future__ import annotations

from urbihw.buses.errors import BadValue
from urbihw.buses.servos.bus import ServoBus
from urbihw.buses.servos.item import Item
from urbihw.buses.servos.member import Member

_ENTRY = 2  # bytes of an address entry


def check_indirect(bus: ServoBus, member: Member, item: Item, raw: int) -> None:
    """Raise BadValue for a write that leads to a register with a name, now or by the address entry that it changes.

    Raises as `bus.read`.
    """
    data = item.pack(raw)
    for entries, first, count in member.table.indirect:
        for at in range(item.address, item.end):
            if entries <= at < entries + _ENTRY * count:
                start = at - (at - entries) % _ENTRY
                old = bus.read(member.device.id, start, _ENTRY)
                new = bytes(
                    data[byte - item.address] if item.address <= byte < item.end else old[byte - start]
                    for byte in range(start, start + _ENTRY)
                )
                _check_byte(member, item, int.from_bytes(new, "little"))
            elif first <= at < first + count:
                entry = bus.read(member.device.id, entries + _ENTRY * (at - first), _ENTRY)
                _check_byte(member, item, int.from_bytes(entry, "little"))


def _check_byte(member: Member, item: Item, address: int) -> None:
    target = member.table.item_around(address)
    if target is not None and "W" in target.access:
        raise BadValue(f"{item.name} of {member.table.name} leads to {target.name}: write that name")
