"""The brick: it executes telegrams, and its motors turn as time passes.

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

STEP = 0.01  # s, maximum step of the motors' physics
SHORTEST_TONE = 0.01  # s
LEAST_HZ, MOST_HZ = 220, 14080
SLEEP_LIMIT = 600_000  # ms; 10 minutes, a setting of the brick's menu
LONGEST = 64  # maximum bytes of a telegram


@dataclass
class Sound:
    """The speaker.  The firmware limits tones to 220..14080 Hz and at least 10 ms.

    Attributes:
        frequency: Hz of the running tone.
        file: the running sound file.
        played: number of tones so far.
    """

    frequency: int = 0
    file: str = ""
    played: int = 0
    _until: float = -1.0

    def play_tone(self, frequency: int, milliseconds: int, now: float) -> None:
        """Play a tone, which replaces the present sound; 0 Hz is silence."""
        self.frequency = max(LEAST_HZ, min(MOST_HZ, frequency)) if frequency else 0
        self.file = ""
        self._until = now + max(SHORTEST_TONE, milliseconds / 1000)
        self.played += 1

    def play_file(self, name: str, loop: bool, now: float) -> None:
        """Play a file: for one second, or endlessly."""
        self.frequency, self.file = 0, name
        self._until = now + (1e9 if loop else 1.0)

    def stop(self) -> None:
        """End the sound at once."""
        self._until = -1.0

    def sounding(self, now: float) -> bool:
        """Return whether a tone or a file is playing."""
        return now < self._until


class Brick:
    """A brick with three motors and four input ports, nothing plugged into the latter.

    Attributes:
        name: at most 15 characters.
        address: its Bluetooth address, 7 bytes in hex, the last of them 0.
        millivolts: of the battery.
        sleep_limit: ms without KEEPALIVE or STARTPROGRAM after which it switches itself off; 0: never.
        awake: it is switched on and answers.
        program: the running program file; "" for none.
        program_power: what the program sets all motors to, percent; None for one that leaves them alone.
        now: time of the present telegram.
        around: called with the elapsed seconds and the time; simulates the surroundings of the brick.
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
        self.program_power: int | None = None
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
        """Plug a device into input 0..3, labelled S1..S4."""
        self.inputs[port].plugged = thing

    def motor(self, letter: str) -> Motor:
        """The motor on A, B or C."""
        return self.motors["ABC".index(letter)]

    def advance(self, now: float) -> None:
        """Advance to `now`."""
        if not self._started:
            self._started, self.now, self._roused_at = True, now, now
        while self.now < now:
            seconds = min(STEP, now - self.now)
            self.now = now if now - self.now <= STEP else self.now + seconds
            for motor in self.motors:
                if self.program and self.program_power is not None:
                    motor.set_output(self.program_power, codes.MOTOR_ON, 0, 0, codes.RUNNING, 0)
                motor.advance(seconds, self.millivolts / 1000)
            self.around(seconds)
            for inlet in self.inputs:
                inlet.advance()
        if self.awake and self.sleep_limit and (self.now - self._roused_at) * 1000 > self.sleep_limit:
            self.switch_off()

    def telegram(self, data: bytes, now: float) -> bytes | None:
        """Execute a telegram; return the reply, if one is requested."""
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
        """Start a program, or stop it with ""; resets motors and sensors as after power-on."""
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
        """Restart the sleep timer."""
        self._roused_at = self.now

    def switch_off(self) -> None:
        """Switch off, as by the sleep timer or when the batteries are removed."""
        self.awake = False
        self.start_program("")
        self.sound.stop()

    def switch_on(self, now: float) -> None:
        """Switch on by the orange button."""
        self.advance(now)
        self.awake = True
        self.start_program("")
        self.stay_awake()
