"""Packets on request: encoders, inputs and outputs, gyro, joystick, batteries, bytes of AUX1."""

from __future__ import annotations

import math
from collections.abc import Callable

from urbihw_fakes.p3dx import numbers, sips
from urbihw_fakes.p3dx.body import Body
from urbihw_fakes.p3dx.camera import Camera, CanonCamera
from urbihw_fakes.p3dx.codec import Command
from urbihw_fakes.p3dx.gripper import Gripper

GYRO_SCALE = 5 / 1023 * 300 / 2.5 * 1.626


class Extras:
    """The packets that are sent after the SIPs: a request of 0 ends them, 1 sends one, more sends one per SIP.

    Attributes:
        gripper, camera: what hangs on the controller. gyro_rest: the gyro's reading at rest, which drifts.
        digital_in, digital_out: one byte each. analog: nine values from 0 to 1023. stick: x and y from 0 to 1023.
    """

    COMMANDS = frozenset({
        numbers.ENCODER, numbers.IOREQUEST, numbers.GYRO, numbers.JOYREQUEST, numbers.BATTERYINFO, numbers.TTY2,
        numbers.GETAUX, numbers.DIGOUT, numbers.GRIPPER,
    })  # fmt: skip

    def __init__(self, body: Body, ticks_mm: int) -> None:
        self._body = body
        self._ticks_mm = ticks_mm
        self.camera: Camera | CanonCamera = Camera()
        self.gripper = Gripper()
        self.gyro_rest = 512.0
        self.digital_in, self.digital_out = 0xFF, 0xFF
        self.analog = [0] * 9
        self.stick = (512, 512)
        self._wanted: dict[int, int] = {}
        self._aux_wanted = 0
        self._makers: dict[int, Callable[[], bytes]] = {
            numbers.ENCODER: self._encoders,
            numbers.IOREQUEST: self._io,
            numbers.GYRO: self._gyro,
            numbers.JOYREQUEST: lambda: sips.joystick(False, False, *self.stick, 0),
            numbers.BATTERYINFO: lambda: sips.batteries([self._charge()]),
        }

    def execute_command(self, order: Command) -> None:
        """Execute one of COMMANDS."""
        if order.number == numbers.GRIPPER:
            self.gripper.act(order.value)
        elif order.number == numbers.TTY2:
            self.camera.receive_bytes(order.text)
        elif order.number == numbers.GETAUX:
            self._aux_wanted = order.value
            if not order.value:
                self.camera.said = b""
        elif order.number == numbers.DIGOUT:
            mask, values = order.value >> 8 & 0xFF, order.value & 0xFF
            self.digital_out = self.digital_out & ~mask | values & mask
        else:
            self._wanted[order.number] = order.value

    def bodies(self) -> list[bytes]:
        """Return the packet bodies that follow this SIP."""
        found = []
        for number, make in self._makers.items():
            wanted = self._wanted.get(number, 0)
            if wanted:
                found.append(make())
                # The gyro packets are on or off; there is no request for a single one.
                if wanted == 1 and number != numbers.GYRO:
                    self._wanted[number] = 0
        if self._aux_wanted and len(self.camera.said) >= self._aux_wanted:
            data, self.camera.said = self.camera.said[: self._aux_wanted], self.camera.said[self._aux_wanted :]
            self._aux_wanted = 0
            found.append(b"\xb0" + data)
        return found

    def drop_requests(self) -> None:
        """Drop all requests: the connection is closed."""
        self._wanted.clear()
        self._aux_wanted = 0

    def _charge(self) -> int:
        return max(0, min(100, round((self._body.volts - 11.0) / 1.5 * 100)))

    def _encoders(self) -> bytes:
        ways = (self._body.left_way, self._body.right_way)
        return sips.encoders(*(_signed32(round(way * 1000 * self._ticks_mm)) for way in ways))

    def _io(self) -> bytes:
        front = 0xFF & ~sum(1 << number + 1 for number in self._body.front)
        rear = 0xFF & ~sum(1 << number + 1 for number in self._body.rear)
        analog = [*self.analog[:8], min(1023, round(self._body.volts / 20 * 1023))]
        return sips.inputs([self.digital_in, front, rear, 0xFF], [self.digital_out], analog)

    def _gyro(self) -> bytes:
        # The gyro feels the true turn of the body.  Its noise spreads the readings over the steps of the converter.
        rate = self.gyro_rest - math.degrees(self._body.turn_rate) / GYRO_SCALE
        return sips.gyro([max(0, min(1023, round(rate + noise / 8))) for noise in (-3, -1, 1, 3)], 30)


def _signed32(value: int) -> int:
    return (value + 2**31) % 2**32 - 2**31
