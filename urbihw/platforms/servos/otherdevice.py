"""Devices on a servo bus that are no servos, or of a model without a control table: registers only, nothing moves."""

from __future__ import annotations

from urbihw.buses.servos.device import DeviceInfo
from urbihw.platforms.channel import DeviceChannel
from urbihw.platforms.servos import slots, words
from urbihw.platforms.servos.devices import Refused, ServoBusDevice


class OtherDevice(ServoBusDevice):
    """A device without a motor, or of an unknown model.

    Its registers are read and written by name or, of an unknown model, by place: ``readRegister("@30:2")`` reads two
    bytes from address 30 on.  Its torque is never touched by itself.
    """

    slot_words = words.DEVICE

    kind_of_device = "device"

    def init(self, channel: DeviceChannel, info: DeviceInfo, refused: Refused) -> None:
        """Have the slots that its control table has of all devices; its first register shows that it lives."""
        table = self.table_for(info)
        self.rows = slots.rows_of(table, slots.COMMON)
        self.hidden = ((next(iter(table.items)), slots.RARE),)
        super().init(channel, info, refused)
