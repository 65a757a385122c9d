"""The sensor module: the class AXS1.

Infrared and light are amounts, 0..255; larger is nearer, or brighter.  ``soundVolume`` is 0..1.  ``remocon`` is the
last word that came from a remote control when read, and sends one when written.

``clapCount`` is the number of claps of the last burst, from 0.8 s after its last clap until the next clap, so that two
bursts of four are 4, 0, 4: the manual's ``at (clapCount == 4)`` happens for both.  The register itself keeps its count
(e-manual, AX-S1, address 37), so it is set to 0 when it has been read; the next clap shows in the time of the last
sound (address 38).
"""

from __future__ import annotations

import math

from urbihw.buses.messages import Reply
from urbihw.buses.servos import units
from urbihw.buses.servos.status import state_words
from urbihw.kernel.uobject import UVar, event, function, number, owned, set_range, variable
from urbihw.platforms.bioloid import sensorslots
from urbihw.platforms.servos.devices import ServoBusDevice
from urbihw.platforms.servos.slots import MEDIUM, ChangeHandler, RegisterSlot

_MELODY = 255
"""As ringing time: play the melody whose number is in the note register."""


class AXS1(ServoBusDevice):
    """An AX-S1, the sensor module of the kit."""

    slot_words = sensorslots.WORDS

    kind_of_device = "sensor"
    rows = sensorslots.AXS1
    hidden = (("remocon_arrived", MEDIUM),)

    buzzerIndex = owned(math.nan)
    buzzerTime = variable(0.5)
    remocon = owned(math.nan)
    remoconReceived = event()

    def prepare(self) -> None:
        """Bind the buzzer and the remote control."""
        self._is_reading = False
        note, word = self.table.item("buzzer_index"), self.table.item("remocon_tx")
        set_range(self.buzzerIndex, note.low, note.high)
        set_range(self.remocon, word.low, word.high)
        self.notify_change(self.buzzerIndex, self._play_note)
        self.notify_change(self.buzzerTime, self._write_time)
        self.notify_change(self.remocon, self._send_word)
        self.on_change("remocon_arrived", self._read_word)
        self.claps = self.variables["clapCount"]
        self.notify_change(self.claps, self._restart_claps)
        self.on_change("sound_time", self._begin_burst)

    # ---------------------------------------------------------------- claps

    def change_handler(self, row: RegisterSlot, var: UVar) -> ChangeHandler:
        """Return the handler of the claps, whose register counts one burst and is set to 0 after it."""
        if row.name != "clapCount":
            return super().change_handler(row, var)

        def show_burst(raw: int, stamp: float) -> None:
            if raw:
                var.sense(float(raw), stamp)
                self.write(row.item, 0, row.name)
            elif math.isnan(var.sensed):
                var.sense(0.0, stamp)

        return show_burst

    def _begin_burst(self, raw: int, stamp: float) -> None:
        if not self._values.get("sound_count"):
            # Otherwise the burst began and ended between two readings.
            self.claps.sense(0.0, stamp)

    def _restart_claps(self) -> None:
        if number(self.claps) != 0:
            raise ValueError("only 0 can be written, which begins a new count")
        self.claps.sense(0.0)
        self.write("sound_count", 0, "clapCount")

    # ---------------------------------------------------------------- buzzer

    @function
    def playMelody(self, melody: int) -> None:
        """Play one of the 27 melodies of the module, 0..26."""
        if not 0 <= melody <= 26:
            raise ValueError(f"there are melodies 0..26, no {melody}")
        self._start_buzzer(melody, _MELODY)

    def _play_note(self) -> None:
        note = number(self.buzzerIndex)
        self.buzzerIndex.sense(note)
        self._start_buzzer(round(note), units.from_si(self.table.item("buzzer_time"), number(self.buzzerTime)))

    def _start_buzzer(self, index: int, time: int) -> None:
        # Requests, because an unchanged target is not sent again, and a note may be played twice.
        self.write("buzzer_index", index, "buzzerIndex")
        self.write("buzzer_time", time, "buzzerTime")

    def _write_time(self) -> None:
        """The length of the next note in s, 0.3..5, inf for ever; 0 ends the one that rings."""
        if units.from_si(self.table.item("buzzer_time"), number(self.buzzerTime)) == 0:
            self.write("buzzer_time", 0, "buzzerTime")

    # ---------------------------------------------------------------- remote control

    def _send_word(self) -> None:
        self.write("remocon_tx", units.from_si(self.table.item("remocon_tx"), number(self.remocon)), "remocon")

    def _read_word(self, raw: int, stamp: float) -> None:
        if raw and not self._is_reading:
            self._is_reading = True
            self.channel.read(self.number, "remocon_rx", self._handle_word)

    def _handle_word(self, reply: Reply) -> None:
        self._is_reading = False
        # Reading the word clears the flag, but the next word may set it again before the flag is read.
        self.mark_unread("remocon_arrived")
        if reply.ok and reply.value is not None:
            self.remocon.sense(float(reply.value))
            self.remoconReceived.emit(float(reply.value))

    def on_state_bits(self, raw: int, stamp: float) -> None:
        """Show the error bits as an alarm."""
        self.show_alarm(state_words(raw, self.protocol))
