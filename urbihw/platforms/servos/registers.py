"""Raw registers of a device by name: for what has no slot, and for experts.

``motor3.readRegister("p_gain")`` waits for the answer of the device (``servos.u``); nothing else waits for it.  A write
obeys the limits, the emergency stop and the stops of the robot as any other, and one that may move a servo ends with
the connection that made it.
"""

from __future__ import annotations

from urbihw.buses.messages import Reply
from urbihw.buses.servos.item import is_place
from urbihw.buses.servos.plan import TORQUE
from urbihw.kernel.uobject import Motion, event, function
from urbihw.platforms.channel import Done
from urbihw.platforms.servos import words
from urbihw.platforms.servos.devices import ServoBusDevice


class RegisterDevice(ServoBusDevice):
    """A device with its registers; ``motion`` is set by the robot."""

    slot_words = words.REGISTERS

    motion: Motion
    answeredRegister = event()

    @function
    def registers(self) -> list[str]:
        """The names of its registers, in order of address."""
        return list(self.table.items)

    @function("askRegister")
    def ask_register(self, name: str) -> int:
        """Read a register; ``answeredRegister`` gets this number, the raw count, and "" or the error."""
        self.table.item(name)
        number, answered = self._register_answer()
        self.channel.read(self.number, name, answered)
        return number

    @function("tellRegister")
    def tell_register(self, name: str, raw: int) -> int:
        """Write a raw count into a register; ``answeredRegister`` gets this number, the count, and "" or the error."""
        item = self.table.item(name)
        if item.access != "RW":
            raise ValueError(f"{name} can only be read")
        item.check(raw)
        number, answered = self._register_answer(name)
        origin = self.motion.admit(self.number) if self._may_move(name, raw) else self.motion.origin()
        self.channel.write(self.number, name, raw, answered, origin)
        return number

    def _may_move(self, name: str, raw: int) -> bool:
        """Return whether a write may move the device in some mode; in its present one, the driver decides again."""
        effectors = {mode.effector for mode in self.table.modes}
        return name in effectors or name.startswith("goal_") or is_place(name) or (name == TORQUE and raw != 0)

    def _register_answer(self, written: str = "") -> tuple[int, Done]:
        """Return the number of a request, and what takes its answer; the slot of a ``written`` register follows."""
        self._asked += 1
        number = self._asked

        def answered(reply: Reply) -> None:
            if reply.ok and written:
                self.update_values({written: reply.value}, self.host.now())
            value = float(reply.value) if reply.ok and isinstance(reply.value, int | float) else None
            self.answeredRegister.emit(number, value, "" if reply.ok else self.explain_error(reply.error))

        return number, answered

    _asked = 0
