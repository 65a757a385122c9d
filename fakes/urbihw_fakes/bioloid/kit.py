"""Simulated Bioloid kits: a bus with the servos and sensors of a kit on it.

    kit = Bioloid()                  # 18 AX-12 with IDs 1..18 and an AX-S1 with ID 100, protocol 1.0, 1 Mbps
    kit = Bioloid.x_series(18)       # 18 XL430-W250, protocol 2.0, 57 600 bps
    kit.feed(bytes.fromhex("FF FF 01 02 01 FB"), 0.0)

With `cm5` the bus is behind a CM-5 in manage mode: it passes bytes through only after `t` and a carriage return (toss
mode), until it is switched off. Its text is not that of a real one, which is not documented. Not covered: its other
commands, linkage between the servos.
"""

from __future__ import annotations

from collections.abc import Iterable

from urbihw_fakes.device import Answer
from urbihw_fakes.dynamixel.ax12 import Ax12
from urbihw_fakes.dynamixel.axs1 import AxS1
from urbihw_fakes.dynamixel.bus import ServoBus
from urbihw_fakes.dynamixel.unit import Unit
from urbihw_fakes.dynamixel.xseries import XSeries
from urbihw_fakes.errors import UnknownRequest

SERVOS = tuple(range(1, 19))
SENSORS = (100,)
_TOSS = b"t\r"


class Bioloid(ServoBus):
    """A kit: AX-12 servos and AX-S1 sensors with these IDs, or any `units`.

    `baud` is what the units are set to. `wait_for_predecessor`: see `urbihw_fakes.dynamixel.bus`.
    """

    def __init__(
        self,
        servos: Iterable[int] = SERVOS,
        sensors: Iterable[int] = SENSORS,
        *,
        units: Iterable[Unit] | None = None,
        baud: int | None = None,
        wait_for_predecessor: bool = True,
        cm5: bool = False,
    ) -> None:
        if units is None:
            units = [*(Ax12(number) for number in servos), *(AxS1(number) for number in sensors)]
        super().__init__(units, wait_for_predecessor=wait_for_predecessor)
        self._cm5 = cm5
        self._tosses = not cm5
        self._typed = b""
        if baud is not None:
            self.set_baud(baud)

    @classmethod
    def x_series(
        cls, count: int = 18, *, model: str = "XL430-W250", baud: int | None = None, wait_for_predecessor: bool = True
    ) -> Bioloid:
        """A kit of `count` X-series servos with IDs from 1 on (models: `urbihw_fakes.dynamixel.xtables.MODELS`)."""
        units = [XSeries(model, number) for number in range(1, count + 1)]
        return cls(units=units, baud=baud, wait_for_predecessor=wait_for_predecessor)

    def receive(self, data: bytes, now: float) -> list[Answer]:
        """Pass bytes to the bus, or to the console of the CM-5."""
        if self._tosses:
            return super().receive(data, now)
        self._typed = (self._typed + data)[-len(_TOSS) :]
        self._tosses = self._typed == _TOSS
        return [Answer(now, b"\r\ntoss mode\r\n")] if self._tosses else []

    def power_off(self, now: float, who: int | None = None) -> None:
        """As that of the bus; a CM-5 without power forgets the toss mode."""
        if who is None:
            self._tosses, self._typed = not self._cm5, b""
        super().power_off(now, who)

    def set_baud(self, baud: int) -> None:
        """Set all units to `baud`, as somebody did before shipping them.

        Raises:
            UnknownRequest: some unit has no setting within 3 % of it.
        """
        for unit in self:
            unit.set_baud(baud)

    def servo(self, number: int) -> Ax12:
        """The AX-12 with this ID.

        Raises:
            NoSuchUnit: nothing has it.
            UnknownRequest: it is something else.
        """
        unit = self[number]
        if not isinstance(unit, Ax12):
            raise UnknownRequest(f"unit {number}: this is {type(unit).__name__}, not an AX-12")
        return unit

    def sensor(self, number: int = 100) -> AxS1:
        """The AX-S1 with this ID.

        Raises:
            NoSuchUnit: nothing has it.
            UnknownRequest: it is something else.
        """
        unit = self[number]
        if not isinstance(unit, AxS1):
            raise UnknownRequest(f"unit {number}: this is {type(unit).__name__}, not an AX-S1")
        return unit

    def x_servo(self, number: int) -> XSeries:
        """The X-series servo with this ID.

        Raises:
            NoSuchUnit: nothing has it.
            UnknownRequest: it is something else.
        """
        unit = self[number]
        if not isinstance(unit, XSeries):
            raise UnknownRequest(f"unit {number}: this is {type(unit).__name__}, not an X-series servo")
        return unit
