"""A brick as a `Device`: telegrams with their length in front, as over Bluetooth.

    len_lo len_hi telegram                 the length does not count its own two bytes

USB has no such prefix; `usb_endpoint` converts, so that log and faults are the same for both.
"""

from __future__ import annotations

from urbihw_fakes.device import Answer, Device
from urbihw_fakes.nxt.brick import LONGEST
from urbihw_fakes.nxt.tribot import TriBot

HEAD = 2
PASS = 0.001  # s, one pass of the firmware's main loop, which answers one telegram
UNIT = 0  # the only unit, for faults


def framed(telegram: bytes) -> bytes:
    """Return a telegram with its length in front."""
    return len(telegram).to_bytes(HEAD, "little") + telegram


class NxtDevice(Device):
    """A TriBot with a framed stream.  A frame with an impossible length drops all received bytes.

    `pass_time` is the duration of a pass of the main loop in seconds; 0 answers at once, for benchmarks of the host.
    """

    def __init__(self, robot: TriBot | None = None, *, pass_time: float = PASS) -> None:
        super().__init__()
        self._pass_time = pass_time
        self.robot = robot if robot is not None else TriBot()
        self.brick = self.robot.brick
        self._buffer = b""

    def receive(self, data: bytes, now: float) -> list[Answer]:
        """Cut the bytes into telegrams and return the framed replies."""
        self._buffer += data
        answers: list[Answer] = []
        while len(self._buffer) >= HEAD:
            length = int.from_bytes(self._buffer[:HEAD], "little")
            if length > LONGEST:
                self._buffer = b""
                break
            if len(self._buffer) < HEAD + length:
                break
            telegram, self._buffer = self._buffer[HEAD : HEAD + length], self._buffer[HEAD + length :]
            reply = self.brick.telegram(telegram, now)
            if reply is not None:
                delay, spoilt = self.faults.disturb(UNIT, framed(reply))
                if spoilt:
                    answers.append(Answer(self._end_of_pass(now) + delay, spoilt))
        return answers

    def _end_of_pass(self, now: float) -> float:
        return (now // self._pass_time + 1) * self._pass_time if self._pass_time else now

    def tick(self, now: float) -> list[Answer]:
        """Advance to `now`; the brick sends no unsolicited data."""
        self.brick.advance(now)
        return []

    def due(self) -> float | None:
        """When a robot in a world wants to move on without a request."""
        return None if self.robot.pace is None or not self.brick.now else self.brick.now + self.robot.pace

    def hang_up(self) -> None:
        """The cable was unplugged: an incomplete frame is dropped, open files are closed."""
        self._buffer = b""
        self.brick.files.close_all()

    def power_off(self, now: float, who: int | None = None) -> None:
        """Switch the brick off."""
        self.brick.advance(now)
        self.brick.switch_off()

    def power_on(self, now: float, who: int | None = None) -> None:
        """Switch the brick on: it boots."""
        self.brick.switch_on(now)
