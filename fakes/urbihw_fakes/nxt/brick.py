"""The brick: a telegram in, a telegram or nothing out; its motors turn while time passes.

    brick = Brick()
    brick.telegram(bytes.fromhex("000b"), 0.0)       # 02 0b 00 d2 1e: 7890 mV
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from urbihw_fakes.nxt import codes, direct, system
from urbihw_fakes.nxt.files import Files
from urbihw_fakes.nxt.inputs import InputPort, Plugged
from urbihw_fakes.nxt.lowspeed import Channel
from urbihw_fakes.nxt.motor import Motor

STEP = 0.01  # s, the longest step in which motors are moved
SHORTEST_TONE = 0.01  # s
LEAST_HZ, MOST_HZ = 220, 14080
SLEEP_LIMIT = 600_000  # ms; the menu of the brick says 10 minutes
LONGEST = 64  # bytes of a telegram


@dataclass
class Sound:
    """What the speaker does.  The firmware keeps tones within 220..14080 Hz and 10 ms and more.

    Attributes:
        frequency: Hz of the running tone.
        file: the running sound file.
        played: how many tones there were.
    """

    frequency: int = 0
    file: str = ""
    played: int = 0
    _until: float = -1.0

    def play_tone(self, frequency: int, milliseconds: int, now: float) -> None:
        """A tone replaces what was playing; 0 Hz is silence."""
        self.frequency = max(LEAST_HZ, min(MOST_HZ, frequency)) if frequency else 0
        self.file = ""
        self._until = now + max(SHORTEST_TONE, milliseconds / 1000)
        self.played += 1

    def play_file(self, name: str, loop: bool, now: float) -> None:
        """One second, or for ever."""
        self.frequency, self.file = 0, name
        self._until = now + (1e9 if loop else 1.0)

    def stop(self) -> None:
        """Silence."""
        self._until = -1.0

    def sounding(self, now: float) -> bool:
        """Whether there is a tone or a file now."""
        return now < self._until


class Brick:
    """A brick with three motors and four input ports, nothing plugged into the latter.

    Attributes:
        name: what it is called; at most 15 characters.
        address: its Bluetooth address, 7 bytes in hex, the last of them 0.
        millivolts: of the battery.
        sleep_limit: ms without KEEPALIVE or STARTPROGRAM after which it switches itself off; 0: never.
        awake: whether it still answers.
        program: the file that runs; "" for none.
        now: the time of the telegram that is being answered.
        around: called with the seconds that pass and the time; moves what is around the brick.
    """

    def __init__(self, millivolts: int = 7890) -> None:
        self.name = "NXT"
        self.address = "00165301020300"
        self.millivolts = millivolts
        self.sleep_limit = SLEEP_LIMIT
        self.motors = [Motor() for _ in range(3)]
        self.inputs = [InputPort() for _ in range(4)]
        self.channels = [Channel() for _ in range(4)]
        self.files = Files()
        self.sound = Sound()
        self.mailboxes: dict[int, list[bytes]] = {}
        self.program = ""
        self.awake = True
        self.now = 0.0
        self.around: Callable[[float], None] = lambda seconds: None
        self._started = False
        self._roused_at = 0.0

    @property
    def serial(self) -> str:
        """The serial number on USB: the address without its last byte."""
        return self.address[:12].upper()

    def plug(self, port: int, thing: Plugged) -> None:
        """Plug something into input 0..3, which is S1..S4."""
        self.inputs[port].plugged = thing

    def motor(self, letter: str) -> Motor:
        """The motor on A, B or C."""
        return self.motors["ABC".index(letter)]

    def advance(self, now: float) -> None:
        """Let time pass until `now`."""
        if not self._started:
            self._started, self.now, self._roused_at = True, now, now
        while self.now < now:
            seconds = min(STEP, now - self.now)
            self.now = now if now - self.now <= STEP else self.now + seconds
            for motor in self.motors:
                motor.advance(seconds, self.millivolts / 1000)
            self.around(seconds)
            for inlet in self.inputs:
                inlet.advance()
        if self.awake and self.sleep_limit and (self.now - self._roused_at) * 1000 > self.sleep_limit:
            self.switch_off()

    def telegram(self, data: bytes, now: float) -> bytes | None:
        """Take a telegram; the reply, if one is wanted."""
        self.advance(now)
        if not self.awake or not 2 <= len(data) <= LONGEST:
            return None
        kind, opcode = data[0] & ~codes.SILENT, data[1]
        silent = bool(data[0] & codes.SILENT)
        table = {codes.DIRECT: direct.COMMANDS, codes.SYSTEM: system.COMMANDS}.get(kind)
        if table is None or (kind == codes.SYSTEM and opcode not in table):
            return None
        reply = self._answer(table, opcode, data, silent)
        return None if silent else bytes([codes.REPLY, opcode]) + reply

    def _answer(
        self, table: dict[int, tuple[direct.Command, int, bool]], opcode: int, data: bytes, silent: bool
    ) -> bytes:
        row = table.get(opcode)
        if row is None:
            return bytes([codes.UNKNOWN_OPCODE])
        command, least, only_gets = row
        if len(data) < least:
            return bytes([codes.INSANE])
        return b"" if silent and only_gets else command(self, data)

    def start_program(self, name: str) -> None:
        """Start a program, or with "" stop it: motors and sensors are as after power-on."""
        self.program = name
        self.mailboxes.clear()
        for motor in self.motors:
            motor.reset()
        for inlet, channel in zip(self.inputs, self.channels, strict=True):
            inlet.reset(self.now)
            channel.configure(codes.NO_SENSOR, self.now)
        if name:
            self.stay_awake()

    def stay_awake(self) -> None:
        """The sleep timer starts anew."""
        self._roused_at = self.now

    def switch_off(self) -> None:
        """As when the sleep timer has run out, or the batteries fall out."""
        self.awake = False
        self.start_program("")
        self.sound.stop()

    def switch_on(self, now: float) -> None:
        """Somebody presses the orange button."""
        self.advance(now)
        self.awake = True
        self.start_program("")
        self.stay_awake()
