"""Raw registers of a device by name: for what has no slot, and for experts.

``motor3.readRegister("p_gain")`` waits for the answer of the device (``servos.u``); nothing else waits for it.  A write
obeys the limits, the emergency stop and the stops of the robot as any other, and one that may move a servo ends with
the connection that made it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from urbihw.buses.messages import Reply
from urbihw.buses.servos.item import ControlTable, is_place
from urbihw.buses.servos.plan import TORQUE
from urbihw.kernel.uobject import DevicePart, Motion, UObject, event, function
from urbihw.platforms.channel import DeviceChannel, Done
from urbihw.platforms.servos import words


class RegisterOwner(Protocol):
    """The device that has the registers."""

    table: ControlTable
    number: int
    channel: DeviceChannel
    motion: Motion

    def update_values(self, values: Mapping[str, int], stamp: float) -> None:
        """Show values that were read."""
        ...

    def explain_error(self, error: str) -> str:
        """Return a refusal in words for the user."""
        ...


class RawRegisters(DevicePart):
    """The registers of one device."""

    slot_words = words.REGISTERS

    answeredRegister = event()

    def __init__(self, device: UObject, owner: RegisterOwner) -> None:
        super().__init__(device)
        self._owner = owner
        self._asked = 0

    @function
    def registers(self) -> list[str]:
        """The names of its registers, in order of address."""
        return list(self._owner.table.items)

    @function("askRegister")
    def ask_register(self, name: str) -> int:
        """Read a register; ``answeredRegister`` gets this number, the raw count, and "" or the error."""
        self._owner.table.item(name)
        number, answered = self._register_answer()
        self._owner.channel.read(self._owner.number, name, answered)
        return number

    @function("tellRegister")
    def tell_register(self, name: str, raw: int) -> int:
        """Write a raw count into a register; ``answeredRegister`` gets this number, the count, and "" or the error."""
        item = self._owner.table.item(name)
        if item.access != "RW":
            raise ValueError(f"{name} can only be read")
        item.check(raw)
        number, answered = self._register_answer(name)
        motion = self._owner.motion
        origin = motion.admit(self._owner.number) if self._may_move(name, raw) else motion.origin()
        self._owner.channel.write(self._owner.number, name, raw, answered, origin)
        return number

    def _may_move(self, name: str, raw: int) -> bool:
        """Return whether a write may move the device in some mode; in its present one, the driver decides again."""
        effectors = {mode.effector for mode in self._owner.table.modes}
        return name in effectors or name.startswith("goal_") or is_place(name) or (name == TORQUE and raw != 0)

    def _register_answer(self, written: str = "") -> tuple[int, Done]:
        """Return the number of a request, and what takes its answer; the slot of a ``written`` register follows."""
        self._asked += 1
        number = self._asked

        def answered(reply: Reply) -> None:
            if reply.ok and written:
                self._owner.update_values({written: reply.value}, self.host.now())
            value = float(reply.value) if reply.ok and isinstance(reply.value, int | float) else None
            self.answeredRegister.emit(number, value, "" if reply.ok else self._owner.explain_error(reply.error))

        return number, answered
