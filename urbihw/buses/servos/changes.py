"""Changes of one servo: its id, its speed, factory values, a restart, the place of a broken predecessor.

Each change is refused while several servos answer to the id, is made with the torque off, and is checked afterwards by
a ping and a read. Whatever ends a change half-way, the servo is reachable: at its old or its new id and speed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final

from urbihw.buses.errors import BadFrame, BadValue, BusTimeout
from urbihw.buses.link import Link
from urbihw.buses.servos import packet, units
from urbihw.buses.servos.bus import ServoBus
from urbihw.buses.servos.device import ServoDevice, ServoScan
from urbihw.buses.servos.line import ServoLine
from urbihw.buses.servos.plan import TORQUE
from urbihw.buses.servos.registers import (
    PINGS_ONLY,
    STORE_TIME,
    Crowded,
    PingsOnly,
    ServoError,
    ServoRegisters,
    bus_for,
    differences,
    write_differences,
)
from urbihw.buses.servos.registers_file import ServoBackup
from urbihw.buses.servos.scan import scan
from urbihw.buses.servos.survey import BAUDS
from urbihw.buses.servos.tables import table_named

Tick = Callable[[], bool]
_FACTORY_RESET: Final = 0x06
_KEEP_ID_AND_SPEED: Final = b"\x02"
_RESTART_TIME: Final = 3.0
_LOOKS: Final = 3
_TOLERANCE: Final = 0.03


def find_all(link: Link, tick: Tick = lambda: False) -> ServoScan:
    """Return all devices at the present speed. Raises LinkGone."""
    return scan(ServoBus(link, "auto"), None, tick)


def find_one(link: Link, number: int | None = None, tick: Tick = lambda: False) -> ServoDevice:
    """Return the device with an id, or the only one of the line.

    Raises Crowded when several answer to that id, ServoError when none does, or when several do and no id is given.
    """
    found = find_all(link, tick) if number is None else _scan_id(link, number, _LOOKS)
    if found is not None and found.conflicts:
        raise Crowded(found.conflicts[0])
    if found is None or not found.devices:
        who = "no servo answers" if number is None else f"no servo with id {number} answers"
        raise ServoError(f"{who} at {link.baud} bps; urbihw scan looks at all speeds")
    if len(found.devices) > 1:
        ids = ", ".join(str(device.id) for device in found.devices)
        raise ServoError(f"{len(found.devices)} servos answer ({ids}): name one by --id, or plug in only one")
    check_alone(link, found.devices[0])
    return found.devices[0]


def check_alone(link: Link, device: ServoDevice) -> None:
    """Raise Crowded when long answers come damaged: two servos may answer a ping alike, but not all of this.

    Raises PingsOnly for a servo that answers pings, and no read at all.
    """
    if device.model == 0:
        raise PingsOnly(device)
    if device.table is None:
        return
    registers = ServoRegisters(link, device)
    for _ in range(_LOOKS):
        try:
            registers.read()
        except BadFrame as error:
            raise Crowded(device.id) from error
        except BusTimeout as error:
            if not device.setup and PINGS_ONLY in device.table.items:
                raise PingsOnly(device) from error
            raise ServoError(f"servo {device.id} answers now and then only: check its cable and supply") from error


def answer_again(link: Link, device: ServoDevice) -> ServoDevice:
    """Let a servo that answers pings only answer everything, without reading it before; its torque is off then.

    A protocol 1.0 servo does not tell its model to a ping, but all models have these two registers at the addresses of
    the AX-12 (e-manual, control tables of AX, RX, EX and MX). Raises ServoError when it still cannot be read, LinkGone.
    """
    table = table_named("AX-12") if device.table is None else device.table
    bus = bus_for(link, device)
    for name, raw in ((TORQUE, 0), (PINGS_ONLY, table.item(PINGS_ONLY).high)):
        item = table.item(name)
        bus.write(device.id, item.address, item.pack(raw), answered=False)
        bus.discard_until(bus.clock.now() + STORE_TIME)
    return find_one(link, device.id)


def set_id(link: Link, device: ServoDevice, new: int) -> ServoDevice:
    """Give a servo another id and return its new description.

    Raises ServoError when the id is taken, impossible, or was not taken over; LinkGone.
    """
    if new == device.id:
        return device
    highest = packet.MAX_ID[device.protocol]
    if not 0 <= new <= highest:
        raise ServoError(f"an id of this servo is 0..{highest}, not {new}")
    _check_free(link, new)
    registers = ServoRegisters(link, device)
    item = registers.table.item("id")
    if "W" not in item.access:
        raise ServoError(f"servo {device.id}: the id of {device.name} cannot be changed: its registers are not known")
    registers.turn_torque_off()
    locked = registers.unlock()
    refusal = registers.transmit(item, new)
    moved = _look(link, new)
    if locked:
        _lock(link, moved or device)
    if moved is None:
        if _look(link, device.id) is not None:
            why = f" (it refused: {refusal})" if refusal else ""
            raise ServoError(f"servo {device.id} has kept its id{why}: nothing is changed, try again")
        raise ServoError(
            f"the servo answers neither as {device.id} nor as {new}: switch it off and on, then urbihw scan "
            f"{_name(link)}"
        )
    return _same(device, moved)


def set_baud(line: ServoLine, device: ServoDevice, baud: int) -> ServoDevice:
    """Set the speed of a servo, in bits per second; the line is then open at it.

    Raises ServoError when the servo has no such speed, its id is taken there, or it did not take it over; BadUrl when
    the port has no such speed; Unavailable, LinkGone.
    """
    if baud == line.baud:
        return device
    if not line.has_speed:
        raise ServoError(f"{line.name}: its speed is not set from here; connect the servo to a serial port")
    before = line.baud
    registers = ServoRegisters(line.link, device)
    item = registers.table.item("baud_rate")
    raw = _speed_code(registers, baud)
    _check_free(line.set_speed(baud), device.id)
    registers = ServoRegisters(line.set_speed(before), device)
    registers.turn_torque_off()
    locked = registers.unlock()
    refusal = registers.transmit(item, raw)
    moved = _look(line.set_speed(baud), device.id)
    if moved is None and _look(line.set_speed(before), device.id) is None:
        raise ServoError(
            f"servo {device.id} answers neither at {before} nor at {baud} bps: switch it off and on, then urbihw scan "
            f"{line.name}"
        )
    if locked:
        _lock(line.link, moved or device)
    if moved is None:
        why = f" (it refused: {refusal})" if refusal else ""
        raise ServoError(f"servo {device.id} has kept its speed of {before} bps{why}: nothing is changed, try again")
    return _same(device, moved)


def check_reset(link: Link, device: ServoDevice) -> None:
    """Raise ServoError for a servo of which it is not known what a reset makes of it."""
    registers = ServoRegisters(link, device)
    if registers.table.eeprom_lock:  # Feetech
        raise ServoError(f"servo {device.id}: what a reset does to {device.name} is not documented; restore a backup")
    if device.protocol != 2:
        _factory_place(registers)


def check_findable(baud: int) -> None:
    """Raise BadValue for a speed that no scan tries: a servo with it would not be found."""
    if not any(abs(baud - speed) <= _TOLERANCE * speed for speed in BAUDS):
        raise BadValue(f"{baud} bps: no scan tries this speed; give one of {', '.join(map(str, sorted(BAUDS)))}")


def reset(line: ServoLine, device: ServoDevice) -> ServoDevice:
    """Give a servo its factory values, but its own id and speed, and return its description.

    A protocol 1.0 servo forgets both; they are written again, for which its factory id must be free at the factory
    speed. Raises ServoError, BadUrl, Unavailable, LinkGone.
    """
    check_reset(line.link, device)
    registers = ServoRegisters(line.link, device)
    registers.turn_torque_off()
    if device.protocol == 2:
        _send_reset(line.link, device, _KEEP_ID_AND_SPEED)
        return _await(line.link, device)
    number, fast = _factory_place(registers)
    baud = line.baud
    if not line.has_speed and baud != fast:
        raise ServoError(f"{line.name}: a reset changes the speed to {fast} bps; use a serial port")
    if (number, fast) != (device.id, baud):
        _check_free(line.set_speed(fast), number)
    link = line.set_speed(baud)
    _send_reset(link, device, b"")
    link = line.set_speed(fast)
    fresh = set_id(link, _await(link, replace(device, id=number)), device.id)
    return set_baud(line, fresh, baud)


def reboot(link: Link, device: ServoDevice) -> ServoDevice:
    """Restart a servo of protocol 2.0, which clears its hardware error. Raises ServoError, LinkGone."""
    if device.protocol != 2:
        raise ServoError(f"servo {device.id}: {device.name} has no reboot: switch it off and on")
    ServoRegisters(link, device).turn_torque_off()
    link.write(packet.reboot_packet(device.id))
    return _await(link, device)


def back_up(link: Link, device: ServoDevice) -> ServoBackup:
    """Return all registers of a servo. Raises BusTimeout, BadFrame, DeviceRefused, ServoError, LinkGone."""
    values = ServoRegisters(link, device).read()
    return ServoBackup(device.id, device.model, device.protocol, device.firmware, link.baud, values)


def changes_to(link: Link, device: ServoDevice, backup: ServoBackup) -> dict[str, tuple[int, int]]:
    """Return the EEPROM items in which a servo differs from a backup: name -> (present value, that of the backup).

    Raises ServoError when the backup is that of another family.
    """
    registers = ServoRegisters(link, device)
    if backup.table is not registers.table:
        raise ServoError(f"servo {device.id} is of model {device.name}, but the backup is of model {backup.name}")
    return differences(registers.table, backup.registers, registers.read())


def restore(link: Link, device: ServoDevice, backup: ServoBackup) -> list[str]:
    """Write back what differs from a backup in the EEPROM; return a line for each item that was not taken over.

    Raises ServoError when the backup is that of another family, LinkGone.
    """
    changes = changes_to(link, device, backup)
    return write_differences(ServoRegisters(link, device), changes) if changes else []


def adopt(line: ServoLine, device: ServoDevice, backup: ServoBackup) -> list[str]:
    """Give a replacement the registers, the id and then the speed of its predecessor.

    `device` is what the line found at its present speed; the line is open at the speed of the predecessor afterwards.
    Returns a line for each item that was not taken over. Raises ServoError, BadUrl, Unavailable, LinkGone.
    """
    changes_to(line.link, device, backup)
    if backup.baud != line.baud:
        if not line.has_speed:
            raise ServoError(f"{line.name}: its speed is not set from here; connect the servo to a serial port")
        _speed_code(ServoRegisters(line.link, device), backup.baud)
        before = line.baud
        _check_free(line.set_speed(backup.baud), backup.id)
        line.set_speed(before)
    device = set_id(line.link, device, backup.id)
    problems = restore(line.link, device, backup)
    if backup.baud != line.baud:
        set_baud(line, device, backup.baud)
    return problems


def _speed_code(registers: ServoRegisters, baud: int) -> int:
    """Return the raw value of a speed. Raises ServoError when the servo has none within 3 % of it."""
    item = registers.table.item("baud_rate")
    if "W" in item.access:
        try:
            raw = units.from_si(item, float(baud))
        except BadValue:
            raw = -1
        if raw >= 0 and abs(units.to_si(item, raw) - baud) <= _TOLERANCE * baud:
            return raw
    raise ServoError(f"servo {registers.device.id}: {registers.device.name} has no speed of {baud} bps")


def _factory_place(registers: ServoRegisters) -> tuple[int, int]:
    """Return the id and the speed in bits per second that a protocol 1.0 servo has after a reset.

    Raises ServoError when they are not known, and for a protocol 2.0 model that is set to protocol 1.0.
    """
    table = registers.table
    number, speed = table.item("id").default, table.item("baud_rate").default
    if number is None or speed is None or table.protocol != registers.device.protocol:
        raise ServoError(f"servo {registers.device.id}: what a reset makes of it is not known; restore a backup")
    exact = units.to_si(table.item("baud_rate"), speed)
    return number, min(BAUDS, key=lambda baud: abs(baud - exact))


def _check_free(link: Link, number: int) -> None:
    """Raise ServoError when anything answers to an id."""
    if _scan_id(link, number, _LOOKS - 1):
        raise ServoError(f"id {number} is taken at {link.baud} bps: choose another one, or unplug that servo")


def _look(link: Link, number: int) -> ServoDevice | None:
    """Return the only device with an id, None if there is none. Raises Crowded, LinkGone."""
    found = _scan_id(link, number, _LOOKS)
    if found is None:
        return None
    if found.conflicts:
        raise Crowded(number)
    return found.devices[0]


def _scan_id(link: Link, number: int, looks: int) -> ServoScan | None:
    """Return what has an id, looking several times: a busy computer must not look like a silent servo."""
    for _ in range(looks):
        found = scan(ServoBus(link, "auto"), [number])
        if found.devices or found.conflicts:
            return found
    return None


def _same(before: ServoDevice, after: ServoDevice) -> ServoDevice:
    """Return `after`. Raises ServoError when it is another model."""
    if (before.model, before.protocol) != (after.model, after.protocol):
        raise ServoError(f"{after.name} answers as {after.id}, where {before.name} was expected: urbihw scan")
    return after


def _lock(link: Link, device: ServoDevice) -> None:
    ServoRegisters(link, device).lock()


def _send_reset(link: Link, device: ServoDevice, params: bytes) -> None:
    bus_for(link, device).send(packet.encode(device.protocol, device.id, _FACTORY_RESET, params))


def _await(link: Link, device: ServoDevice) -> ServoDevice:
    """Return a device that restarts, as soon as it answers. Raises ServoError after _RESTART_TIME, LinkGone."""
    end = link.clock.now() + _RESTART_TIME
    while True:
        found = _look(link, device.id)
        if found is not None and found.is_complete:
            return _same(device, found)
        if link.clock.now() > end:
            raise ServoError(f"servo {device.id} does not come back at {link.baud} bps: switch it off and on")


def _name(link: Link) -> str:
    return link.url.text.partition("?")[0]
