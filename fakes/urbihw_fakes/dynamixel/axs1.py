"""AX-S1: the sensor module of protocol 1.0 (infra-red distance, light, sound, buzzer, remote control).

Methods set the sensed values; the behaviour follows the sheet: flags by comparison, claps counted with a dead time of
80 ms and stored 800 ms after the last, a maximum sound level that is held, a buzzer that ends by itself.

Model choices: EEPROM 11..13 and the compare values have the defaults below (unconfirmed); a melody lasts
`MELODY_TIME`; writing 0 to the buzzer time ends a sound that is playing, and otherwise rings for 0.3 s. Not covered:
the low-sensitivity mode changes no readings (compare 0 is a comparison with 0), infra-red between two modules.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Callable
from dataclasses import dataclass

from urbihw_fakes.dynamixel import packet1
from urbihw_fakes.dynamixel.registers import Register
from urbihw_fakes.dynamixel.unit1 import Unit1

CLAP_DEAF = 0.08  # s after a counted sound in which no other is counted
CLAP_BURST = 0.8  # s from the last counted sound until the count is stored
SOUND_TICK = 4.096e-3 / 65536  # s of the free-running counter
QUIET = 128
LOUD = 255
MELODY_TIME = 2.0  # s
FOREVER = 254
MELODY = 255
MIN_RING, MAX_RING = 0.3, 5.0  # s
REMOCON_READY = 2

TABLE = (
    Register("model", 0, 2, 13, writable=False, eeprom=True),
    Register("firmware", 2, 1, 16, writable=False, eeprom=True),
    Register("id", 3, 1, 100, 0, 253, eeprom=True),
    Register("baud", 4, 1, 1, 0, 254, eeprom=True),
    Register("return_delay", 5, 1, 250, 0, 254, eeprom=True),
    Register("temperature_limit", 11, 1, 70, 0, 150, eeprom=True),
    Register("min_voltage", 12, 1, 60, 50, 250, eeprom=True),
    Register("max_voltage", 13, 1, 140, 50, 250, eeprom=True),
    Register("status_level", 16, 1, 2, 0, 2, eeprom=True),
    Register("obstacle_threshold", 20, 1, 32, eeprom=True),
    Register("light_threshold", 21, 1, 128, eeprom=True),
    Register("ir_left", 26, 1, writable=False),
    Register("ir_center", 27, 1, writable=False),
    Register("ir_right", 28, 1, writable=False),
    Register("light_left", 29, 1, writable=False),
    Register("light_center", 30, 1, writable=False),
    Register("light_right", 31, 1, writable=False),
    Register("obstacle_flags", 32, 1, writable=False),
    Register("light_flags", 33, 1, writable=False),
    Register("sound", 35, 1, QUIET, writable=False),
    Register("sound_max", 36, 1, 0),
    Register("sound_count", 37, 1, 0),
    Register("sound_time", 38, 2, 0),
    Register("buzzer_note", 40, 1, 0, 0, 51),
    Register("buzzer_time", 41, 1, 0),
    Register("present_voltage", 42, 1, writable=False),
    Register("present_temperature", 43, 1, writable=False),
    Register("registered", 44, 1, 0, 0, 1),
    Register("remocon_arrived", 46, 1, writable=False),
    Register("lock", 47, 1, 0, 1, 1),
    Register("remocon_rx", 48, 2, writable=False),
    Register("remocon_tx", 50, 2),
    Register("obstacle_compare", 52, 1),
    Register("light_compare", 53, 1),
)


@dataclass(frozen=True, slots=True)
class Sound:
    """One sound of the buzzer: when it began, note or melody number, and when it ends by itself (None: never)."""

    began: float
    number: int
    melody: bool
    ends: float | None


class AxS1(Unit1):
    """One AX-S1.

    Attributes that may be set: `volts`, `celsius`. To read: `playing` (the sound of the buzzer, or
    None), `played` (all sounds begun), `sent` (remote-control words sent).
    """

    def __init__(self, unit: int = 100) -> None:
        super().__init__(unit, TABLE)
        self.volts = 12.0
        self.celsius = 30.0
        self.playing: Sound | None = None
        self.played: list[Sound] = []
        self.sent: list[int] = []
        self._distances = (0, 0, 0)
        self._lights = (0, 0, 0)
        self._level = QUIET
        self._claps: list[float] = []  # sounds to come, in order of time
        self._count = 0
        self._last_clap: float | None = None
        self._counter_zero = 0.0
        self.sensors = self._sensors()
        self.boot()

    def boot(self) -> None:
        """Power-on values: compare values from the EEPROM, silence, nothing counted."""
        super().boot()
        for live, kept in (("obstacle_compare", "obstacle_threshold"), ("light_compare", "light_threshold")):
            self.registers.put(live, self.registers.get(kept))
        self.playing = None
        self._count = 0
        self._last_clap = None

    # --- the world around it --------------------------------------------------------------------------------------

    def ir(self, left: int, center: int, right: int) -> None:
        """Set the distances: 0..255 each, larger is nearer."""
        self._distances = (left, center, right)

    def light(self, left: int, center: int, right: int) -> None:
        """Set the ambient infra-red light: 0..255 each."""
        self._lights = (left, center, right)

    def sound(self, level: int) -> None:
        """Set the level of the microphone from now on: 0..255, silence is 127..128. It updates the maximum level."""
        self._level = level
        self._loudest(level)

    def clap(self, now: float, count: int = 1, *, spacing: float = 0.2) -> None:
        """Clap `count` times, at `now` and every `spacing` seconds from then on."""
        for number in range(count):
            insort(self._claps, now + number * spacing)

    def remocon(self, word: int) -> None:
        """Receive two bytes (0..65535) by remote control."""
        self.registers.put("remocon_rx", word)
        self.registers.put("remocon_arrived", REMOCON_READY)

    # --- what it makes of it --------------------------------------------------------------------------------------

    def state_errors(self) -> int:
        """The error bits of voltage and heat."""
        get = self.registers.get
        inside = get("min_voltage") <= round(self.volts * 10) <= get("max_voltage")
        return (0 if inside else packet1.ERR_VOLTAGE) | (
            packet1.ERR_HEAT if int(self.celsius) > get("temperature_limit") else 0
        )

    def advance(self, elapsed: float) -> None:
        """Count due claps, store completed bursts, end a sound."""
        until = self.now + elapsed
        while self._claps and self._claps[0] <= until:
            clap = self._claps.pop(0)
            if self.powered:
                self._store_burst(clap)
                self._count_clap(clap)
        self._store_burst(until)
        if self.playing is not None and self.playing.ends is not None and self.playing.ends <= until:
            self._fall_silent()

    def _count_clap(self, clap: float) -> None:
        self._loudest(LOUD)
        if self._last_clap is not None and clap - self._last_clap < CLAP_DEAF:
            return
        self._last_clap = clap
        self._count += 1
        self.put("sound_time", int((clap - self._counter_zero) / SOUND_TICK) % 65536)

    def _store_burst(self, until: float) -> None:
        if self._count and self._last_clap is not None and until - self._last_clap >= CLAP_BURST:
            self.put("sound_count", min(255, self._count))
            self._count = 0

    def _loudest(self, level: int) -> None:
        self.put("sound_max", max(level, self.registers.get("sound_max")))

    def _sensors(self) -> dict[str, Callable[[], int]]:
        return {
            "ir_left": lambda: self._distances[0],
            "ir_center": lambda: self._distances[1],
            "ir_right": lambda: self._distances[2],
            "light_left": lambda: self._lights[0],
            "light_center": lambda: self._lights[1],
            "light_right": lambda: self._lights[2],
            "obstacle_flags": lambda: self._flags(self._distances, "obstacle_compare"),
            "light_flags": lambda: self._flags(self._lights, "light_compare"),
            "sound": lambda: self._level,
            "present_voltage": lambda: round(self.volts * 10) & 0xFF,
            "present_temperature": lambda: max(0, min(255, int(self.celsius))),
        }

    def _flags(self, values: tuple[int, int, int], compare: str) -> int:
        limit = self.registers.get(compare)
        return sum((value > limit) << place for place, value in enumerate(values))

    def after_read(self, address: int, count: int) -> None:
        """Reading the remote-control word clears its flag."""
        if address < 50 and address + count > 48:
            self.registers.put("remocon_arrived", 0)

    def written(self, register: Register, value: int, before: int) -> None:
        """The buzzer starts or stops, the sound counter restarts, a remote-control word leaves."""
        if register.name == "buzzer_time":
            self._buzz(value)
        elif register.name == "sound_time":
            self._counter_zero = self.now - value * SOUND_TICK
        elif register.name == "remocon_tx":
            self.sent.append(value)

    def _buzz(self, value: int) -> None:
        if value == 0 and self.playing is not None:
            self._fall_silent()
            return
        length: float | None
        if value == FOREVER:
            length = None
        elif value == MELODY:
            length = MELODY_TIME
        else:
            length = max(MIN_RING, min(MAX_RING, value / 10))
        ends = None if length is None else self.now + length
        self.playing = Sound(self.now, self.registers.get("buzzer_note"), value == MELODY, ends)
        self.played.append(self.playing)

    def _fall_silent(self) -> None:
        self.playing = None
        self.registers.put("buzzer_time", 0)
