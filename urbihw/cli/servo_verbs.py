"""What the verbs of ``urbihw servo`` do, on an open line and in a dialogue."""

from __future__ import annotations

import argparse
import datetime
import re
from collections.abc import Iterable, Iterator
from typing import Final

from urbihw.buses.errors import BadValue
from urbihw.buses.servos import changes, registers_file
from urbihw.buses.servos.device import ServoDevice
from urbihw.buses.servos.item import ControlTable
from urbihw.buses.servos.line import ServoLine
from urbihw.buses.servos.registers import Crowded, PingsOnly, ServoError, ServoRegisters, bus_for
from urbihw.buses.servos.registers_file import ServoBackup, describe
from urbihw.buses.servos.survey import survey
from urbihw.cli.dialogue import Dialogue
from urbihw.frozen import frozen
from urbihw.started import as_typed

_ALL: Final = "all"
_ANSWER_AGAIN: Final = "status_return_level=2"
_ADDRESS: Final = re.compile(r"([0-9]{1,5})(?::([0-9]{1,3}))?")


@frozen(slots=False)
class VerbJob:
    """A verb to carry out.

    Attributes:
        line: the open line.
        options: of the command.
        dialogue: with the user.
    """

    line: ServoLine
    options: argparse.Namespace
    dialogue: Dialogue

    def find(self, number: int | None) -> ServoDevice:
        """Return the servo with an id, or the only one; if several answer to one id, ask to unplug all but one.

        Raises ServoError.
        """
        while True:
            try:
                return changes.find_one(self.line.link, number)
            except Crowded as error:
                self.dialogue.say(f"More than one servo answers to id {error.number}.")
                self.dialogue.wait("Unplug all servos with this id but one")


def set_id(job: VerbJob) -> None:
    """Give one servo after the other an id."""
    wanted = job.options.new
    if len(wanted) == 1:
        _set_one_id(job, job.options.id, wanted[0])
        return
    if job.options.id is not None:
        raise BadValue("--id goes with one new id only")
    changed: int | None = None
    for new in wanted:
        job.dialogue.wait(f"Plug in only the servo that becomes {new}")
        while changed is not None and changed in (device.id for device in changes.find_all(job.line.link).devices):
            job.dialogue.say(f"This is still servo {changed}, which has just got its id.")
            job.dialogue.wait(f"Plug in only the servo that becomes {new}")
        changed = new if _set_one_id(job, None, new).id != new else None


def _set_one_id(job: VerbJob, number: int | None, new: int) -> ServoDevice:
    """Give a servo an id; return its description from before."""
    device = job.find(number)
    changes.set_id(job.line.link, device, new)
    job.dialogue.say(f"{device.name}: id {device.id} -> {new}, checked; its torque is off")
    return device


def set_baud(job: VerbJob) -> None:
    """Set the speed of a servo."""
    changes.check_findable(job.options.baud)
    before, device = job.line.baud, job.find(job.options.id)
    changes.set_baud(job.line, device, job.options.baud)
    job.dialogue.say(f"servo {device.id}: {before} -> {job.options.baud} bps, checked; its torque is off")


def read(job: VerbJob) -> None:
    """Print registers, by name or address."""
    device = job.find(job.options.id)
    words = job.options.registers
    names = [word for word in words if word != _ALL and not _ADDRESS.fullmatch(word)]
    if names or _ALL in words:
        registers = ServoRegisters(job.line.link, device)
        for name, raw in registers.read(None if _ALL in words else names).items():
            unit = describe(registers.table, name, raw)
            address = registers.table.item(name).address
            job.dialogue.say(f"{address:4} {name:24} {raw}" + (f"  ({unit})" if unit else ""))
    for word in words:
        if match := _ADDRESS.fullmatch(word):
            size = int(match[2] or 1)
            data = bus_for(job.line.link, device).read(device.id, int(match[1]), size)
            job.dialogue.say(f"{int(match[1]):4} {data.hex(' ').upper()}")


def write(job: VerbJob) -> None:
    """Write registers, by name or address."""
    try:
        device = job.find(job.options.id)
    except PingsOnly as error:
        if job.options.registers != [_ANSWER_AGAIN]:
            raise
        changes.answer_again(job.line.link, error.device)
        job.dialogue.say(f"servo {error.device.id}: {_ANSWER_AGAIN}: it answers again; its torque is off")
        return
    registers = ServoRegisters(job.line.link, device)
    wanted = [_assignment(registers.table, word) for word in job.options.registers]
    for name, raw in wanted:
        # All are checked before the first is written.
        registers.check_writable(registers.table.item(name))
        registers.check_value(registers.table.item(name), raw)
    for name, raw in wanted:
        before = registers.read_one(name)
        registers.write(name, raw)
        words = describe(registers.table, name, raw)
        job.dialogue.say(f"servo {device.id}: {name} {before} -> {raw}" + (f" ({words})" if words else ""))
    if registers.torque_was_on:
        job.dialogue.say(f"servo {device.id}: its torque is off now")


def _assignment(table: ControlTable, word: str) -> tuple[str, int]:
    """Return the item and the raw value of NAME=VALUE or ADDRESS=VALUE. Raises BadValue."""
    name, _, value = word.partition("=")
    try:
        raw = int(value, 0)
    except ValueError:
        raise BadValue(f"{word!r}: write NAME=VALUE with a whole number, such as return_delay_time=0") from None
    if name.isdecimal():
        name = next((item.name for item in table.items.values() if item.address == int(name)), name)
        if name.isdecimal():
            raise BadValue(f"{word!r}: no register begins at address {name}")
    return name, raw


def reset(job: VerbJob) -> None:
    """Give a servo its factory values."""
    device = job.find(job.options.id)
    changes.check_reset(job.line.link, device)
    question = f"servo {device.id} ({device.name}) loses all its settings but id and speed. Go on?"
    if not (job.options.yes or job.dialogue.confirm(question)):
        raise ServoError("nothing is changed")
    changes.reset(job.line, device)
    job.dialogue.say(f"servo {device.id}: factory values, checked; its torque is off")


def reboot(job: VerbJob) -> None:
    """Restart a servo, as after a loss of power."""
    device = job.find(job.options.id)
    changes.reboot(job.line.link, device)
    job.dialogue.say(f"servo {device.id}: restarted")


def back_up(job: VerbJob) -> None:
    """Write the registers of all servos, or one, to a file."""
    backups = read_backups(job, devices(job, job.options.id))
    kept = registers_file.save(job.options.file, backups, title(job.line))
    job.dialogue.say(f"{len(backups)} servos in {job.options.file}" + (f"; the former file is {kept}" if kept else ""))


def title(line: ServoLine) -> str:
    """The comment at the head of a backup."""
    return f"Registers of the servos on {line.name}, {datetime.date.today().isoformat()}."


def read_backups(job: VerbJob, found: Iterable[ServoDevice]) -> list[ServoBackup]:
    """Read all registers of these servos. Raises ServoError for one whose registers are not known."""
    return [changes.back_up(job.line.link, device) for device in found]


def devices(job: VerbJob, number: int | None = None) -> list[ServoDevice]:
    """All servos of the line, or one. Raises ServoError when two have one id, or none answers."""
    if number is not None:
        return [job.find(number)]
    found = changes.find_all(job.line.link)
    if found.conflicts:
        raise Crowded(found.conflicts[0])
    if not found.devices:
        raise ServoError(f"no servo answers at {job.line.baud} bps; {as_typed('urbihw scan')} looks at all speeds")
    return list(found.devices)


def restore(job: VerbJob) -> None:
    """Write back what differs in the EEPROM."""
    backups = registers_file.load(job.options.file)
    if job.options.id is not None and job.options.id not in backups:
        raise BadValue(f"{job.options.file} has no servo {job.options.id}")
    found = {device.id: device for device in devices(job, job.options.id)}
    if job.options.id is None and (missing := sorted(backups.keys() - found.keys())):
        job.dialogue.say(f"not found: servo {', '.join(map(str, missing))}")
    problems, changed = [], []
    for device in found.values():
        # All differences are shown before the first is written.
        try:
            if _tell_changes(job, device, backups.get(device.id)):
                changed.append(device)
        except ServoError as error:
            problems.append(str(error))
    for device in changed:
        problems += _restore_one(job, device, backups[device.id])
    tell_problems(problems)


def _tell_changes(job: VerbJob, device: ServoDevice, backup: ServoBackup | None) -> bool:
    """Tell how a servo differs from its backup, and return whether it does. Raises ServoError for another model."""
    if backup is None:
        job.dialogue.say(f"servo {device.id}: not in the backup")
        return False
    changed = changes.changes_to(job.line.link, device, backup)
    if not changed:
        job.dialogue.say(f"servo {device.id}: as in the backup")
    for name, (before, after) in changed.items():
        job.dialogue.say(f"servo {device.id}: {name} {before} -> {after}")
    return bool(changed)


def _restore_one(job: VerbJob, device: ServoDevice, backup: ServoBackup) -> list[str]:
    if not (job.options.yes or job.dialogue.confirm(f"Write these to servo {device.id}?")):
        job.dialogue.say(f"servo {device.id}: nothing is changed")
        return []
    return changes.restore(job.line.link, device, backup)


def adopt(job: VerbJob) -> None:
    """Give a replacement the place of its predecessor."""
    backups = registers_file.load(job.options.file)
    backup = backups.get(job.options.id)
    if backup is None:
        raise BadValue(f"{job.options.file} has no servo {job.options.id}")
    device = _replacement(job, set(backups) - {backup.id})
    now = f"{device.name} with id {device.id} at {job.line.baud} bps"
    if not (job.options.yes or job.dialogue.confirm(f"{now} becomes servo {backup.id} at {backup.baud} bps. Go on?")):
        raise ServoError("nothing is changed")
    problems = changes.adopt(job.line, device, backup)
    what = "id and speed" if problems else "id, speed and registers"
    job.dialogue.say(f"servo {backup.id}: {what} are those of its predecessor; its torque is off")
    job.dialogue.say(f"Check its zero by hand: the horn may sit differently ({as_typed('urbihw calibrate')}).")
    tell_problems(problems)


def _replacement(job: VerbJob, others: set[int]) -> ServoDevice:
    """Return the servo that is to be adopted; the line is at its speed then. `others`: ids of the other servos."""
    if job.options.found is not None:
        return job.find(job.options.found)
    while True:
        found = changes.find_all(job.line.link)
        strangers = [device for device in found.devices if device.id not in others]
        if not found.conflicts:
            break
        job.dialogue.say(f"More than one servo answers to id {found.conflicts[0]}.")
        job.dialogue.wait("Unplug all of them but the new one")
        others -= {found.conflicts[0]}
    if not strangers and job.line.has_speed:
        strangers = list(_at_other_speeds(job))
    if len(strangers) != 1:
        ids = ", ".join(str(device.id) for device in strangers)
        who = f"{len(strangers)} servos are not in the backup ({ids})" if strangers else "no new servo answers"
        raise ServoError(f"{who}: name it by --found, or plug in only the new one")
    changes.check_alone(job.line.link, strangers[0])
    return strangers[0]


def _at_other_speeds(job: VerbJob) -> Iterator[ServoDevice]:
    """Yield the servos at all other speeds; the line is left at that of the last one."""
    job.dialogue.say(f"no new servo at {job.line.baud} bps: looking at all speeds")
    before = job.line.baud
    found = [servo for servo in survey(job.line).servos if servo.baud != before]
    job.line.set_speed(found[-1].baud if found else before)
    yield from (servo.device for servo in found)


def tell_problems(problems: list[str]) -> None:
    """Raise ServoError with all problems if there are any."""
    if problems:
        raise ServoError("; ".join(problems))
