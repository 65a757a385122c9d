"""The values of slots as samples at a rate: what a Subscription sends (docs/telemetry.md)."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, Final

from urbihw.kernel.library import Job, Value, World, errors
from urbihw.robot.json_text import json_number, json_of, json_string
from urbihw.robot.sampling import Feed, feeds_of
from urbihw.robot.slot_reading import Unreadable, make_reader, parse_path, unit_of

MAX_SLOTS: Final = 1000
"""Maximum number of slots of a subscription."""
MAX_READINGS_PER_S: Final = 40_000
"""Maximum number of readings in a second of all subscriptions of a connection."""
MAX_SAMPLE_LENGTH: Final = 1024 * 1024
"""Maximum length of the line of a sample; the values behind are null."""
ERROR_PERIOD_S: Final = 1.0
"""Seconds between two errors of a slot that fails now and then."""


class SlotSample:
    """One slot of a subscription, and its last value as JSON."""

    __slots__ = ("_value", "error", "error_at", "job", "name", "read", "text", "unit", "world")

    def __init__(self, world: World, this: Value, name: str) -> None:
        self.world = world
        self.name = name
        steps = parse_path(world, name)
        self.read = make_reader(world, this, steps)
        self.unit = unit_of(world, this, steps)
        self.text = "null"
        self.error = ""
        self.error_at = -math.inf
        self.job: Job | None = None
        """The job that reads this slot alone, because its getter takes longer than a period."""
        self._value: Any = self

    def refresh(self) -> str:
        """Read; returns a new error as one line of text, else ""."""
        try:
            value = self.read()
            if value.__class__ is float:
                if value is not self._value:
                    self.text = json_number(value)
                    self._value = value
            else:
                self._value = self
                self.text = json_of(self.world, value)
        except Unreadable as error:
            return self._failed(str(error))
        except Exception as error:
            return self._failed(self.world.describe(error)[0])
        if self.error and self.world.scheduler.now - self.error_at > ERROR_PERIOD_S:
            self.error = ""
        return ""

    def _failed(self, text: str) -> str:
        self._value = self
        self.text = "null"
        now = self.world.scheduler.now
        is_new = text != self.error and now - self.error_at >= (ERROR_PERIOD_S if self.error else 0.0)
        if text == self.error:
            self.error_at = now
        if not is_new:
            return ""
        self.error, self.error_at = text, now
        return text


class ValueFeed(Feed):
    """Sends the values of slots."""

    def __init__(self, world: World, face: Any, name: str, slots: list[str], rate: float) -> None:
        self.slots: list[SlotSample] = []
        self._at: SlotSample | None = None
        """The slot that the job reads."""
        self._sent: list[str] = []
        super().__init__(world, face, name, rate)
        try:
            self._take(slots)
        except BaseException:
            self.close()
            raise

    def add(self, names: list[str]) -> None:
        """Read further slots, too; those that are read already are not read twice."""
        known = {slot.name for slot in self.slots}
        self._take([name for name in names if name not in known])

    def remove(self, names: list[str]) -> None:
        """Read some slots no more."""
        gone = [slot for slot in self.slots if slot.name in names]
        self.slots = [slot for slot in self.slots if slot.name not in names]
        for slot in gone:
            if slot.job is not None:
                self.world.scheduler.kill(slot.job)
        self.tell_names()

    def check_readings(self, count: int, rate: float) -> None:
        """Raise an urbiscript error if the connection would have too many readings in a second."""
        if count > MAX_SLOTS:
            raise errors.primitive(f"a subscription has {MAX_SLOTS} slots at most")
        others = sum(
            len(feed.slots) / feed.period
            for feed in feeds_of(self.lobby) if isinstance(feed, ValueFeed) and feed is not self
        )  # fmt: skip
        if others + count * (rate or 1 / self.period) > MAX_READINGS_PER_S:
            raise errors.primitive(f"a connection has {MAX_READINGS_PER_S} readings in a second at most: "
                                   "subscribe fewer slots, or less often")

    def tell_names(self) -> None:
        """Send the names and the units."""
        names = ", ".join([json_string(slot.name) for slot in self.slots])
        units = ", ".join([json_string(slot.unit) for slot in self.slots])
        self._sent = []
        self.send_line(f'{{"names": [{names}], "units": [{units}], "hz": {json_rate(self.rate)}, '
                       f'"time": {seconds(self.world)}}}')

    def _take(self, names: list[str]) -> None:
        self.check_readings(len(self.slots) + len(names), self.rate)
        self.slots = [*self.slots, *[SlotSample(self.world, self.lobby, name) for name in dict.fromkeys(names)]]
        self.tell_names()

    # ---------------------------------------------------------------- the job

    def sample(self) -> None:
        """Read all slots but the slow ones, and send the sample."""
        slots = self.slots
        job = self.world.scheduler.running()
        for slot in slots:
            if slot.job is not None:
                continue
            self._at = slot
            error = slot.refresh()
            if error:
                self._tell_error(slot, error)
            if slot.job is job:
                self._go_on_reading(slot)
                return
        self._at = None
        if slots is self.slots and not self.closed:
            self._send_sample([slot.text for slot in slots])

    def leave_out(self, count: int) -> None:
        """Count samples that are left out; there are none where only changes are sent."""
        if self.rate:
            self.number += count
            self.lost += count

    def _send_sample(self, texts: list[str]) -> None:
        if not self.rate:
            if texts == self._sent:
                return
            self._sent = texts
        self.number += 1
        self.sent += 1
        values = ", ".join(texts)
        if len(values) > MAX_SAMPLE_LENGTH:
            values = ", ".join(_cut(texts))
        self.send_line(f'{{"n": {self.number}, "lost": {self.lost}, "t": {seconds(self.world)}, "v": [{values}]}}')

    def _tell_error(self, slot: SlotSample, text: str) -> None:
        self.send_line(f'{{"error": {json_string(slot.name)}, "text": {json_string(text)}}}')

    # ---------------------------------------------------------------- slow slots

    def jobs(self) -> list[Job]:
        """The job of the samples, and those of slow slots."""
        return [*super().jobs(), *(slot.job for slot in self.slots if slot.job is not None)]

    def is_held_up(self) -> bool:
        """Whether the job waits in a getter."""
        return self._at is not None

    def hand_over(self, job: Job) -> None:
        """Let the job read the slot at which it waits, and no other."""
        slot, self._at = self._at, None
        assert slot is not None
        slot.job = job
        job.when_ended(lambda _: setattr(slot, "job", None))

    def _go_on_reading(self, slot: SlotSample) -> None:
        """In the job of a slow slot: read it at the rate, or as often as it can be read."""
        while not self.closed and slot in self.slots:
            self.world.scheduler.sleep(self.period)
            error = slot.refresh()
            if error and self.lobby.output.backlog == 0:
                self._tell_error(slot, error)


def _cut(texts: Iterable[str]) -> list[str]:
    """The values for which there is room, and null for the others."""
    left = MAX_SAMPLE_LENGTH
    kept = []
    for text in texts:
        left -= len(text)
        kept.append(text if left > 0 else "null")
    return kept


def seconds(world: World) -> str:
    """The time of this round as JSON, in s."""
    return f"{world.scheduler.now:.4f}"


def json_rate(rate: float) -> str:
    """A rate in Hz as JSON, without a needless ".0"."""
    return f"{rate:g}"
