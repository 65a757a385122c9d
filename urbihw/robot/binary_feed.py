"""The newest content of a slot with a Binary: what a Subscription of a camera sends (docs/telemetry.md)."""

from __future__ import annotations

from typing import Any

from urbihw.kernel.library import BinaryObject, World
from urbihw.robot.json_text import json_string
from urbihw.robot.sampling import Feed
from urbihw.robot.slot_reading import Unreadable
from urbihw.robot.value_feed import SlotSample, json_rate, seconds


class BinaryFeed(Feed):
    """Sends the newest content of a slot with a Binary, such as the picture of a camera."""

    def __init__(self, world: World, face: Any, name: str, slot: str, rate: float, window: int) -> None:
        self.slot = SlotSample(world, world.scheduler.running().context, slot)
        self.window = window
        self.open = window
        """How many the client takes before it is ready again."""
        self._seen: Any = None
        self._is_unsent = False
        """Whether the last content seen was not sent yet."""
        super().__init__(world, face, name, rate)
        self.send_line(f'{{"names": [{json_string(slot)}], "units": [""], "hz": {json_rate(rate)}, '
                       f'"time": {seconds(world)}}}')

    def ready(self) -> None:
        """The client takes one more."""
        self.open = min(self.open + 1, self.window)

    def sample(self) -> None:
        """Send the newest content, if the client has not got it and takes it."""
        value = self._read()
        if value is None:
            return
        if value is not self._seen:
            self.number += 1
            self.lost += self._is_unsent
            self._seen, self._is_unsent = value, True
        if not self._is_unsent or (self.window and not self.open):
            return
        self.open -= 1
        self.sent += 1
        self._is_unsent = False
        self.send_line(f'{{"n": {self.number}, "lost": {self.lost}, "t": {seconds(self.world)}}}')
        head = f" {value.keywords}" if value.keywords else ""
        self.send_line(f"BIN {len(value.content)}{head}\n{value.data}")

    def _read(self) -> BinaryObject | None:
        """The content; None for none.  An error is sent once."""
        slot = self.slot
        try:
            value = slot.read()
        except Unreadable as error:
            text = str(error)
        except Exception as error:
            text = self.world.describe(error)[0]
        else:
            if isinstance(value, BinaryObject):
                slot.error = ""
                return value if value.content else None  # a camera that is off has no picture
            text = "" if value is self.world.nil or value is self.world.void else "this slot has no Binary"
        if text != slot.error:
            slot.error = text
            if text:
                self.send_line(f'{{"error": {json_string(slot.name)}, "text": {json_string(text)}}}')
        return None

    def leave_out(self, count: int) -> None:
        """What was not read is not lost: the newest content is sent later."""

    def is_held_up(self) -> bool:
        """Never: there is no other slot that would wait."""
        return False
