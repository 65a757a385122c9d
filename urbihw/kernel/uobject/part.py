"""Parts of a device: objects with one job each, whose variables, events and functions are slots of the device.

A large device is composed of them instead of deriving from one base class for each job::

    class Gauge(DevicePart):
        level = reading(0.0)

        @function
        def empty(self) -> None: ...

    class Tank(UObject):
        parts = (Gauge,)                    # Tank has the slots level and empty

        def init(self) -> None:
            self.gauge = Gauge(self)        # the part that has them

"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, ClassVar

if TYPE_CHECKING:
    from urbihw.kernel.uobject.uobject import UObject


class DevicePart:
    """Base class of the parts of a device, which names their classes in ``parts`` and makes one of each in ``init``.

    ``notify_change``, timers and the like are those of ``device``.
    """

    slot_words: ClassVar[Mapping[str, tuple[str, str]]] = {}
    """As in a device."""

    def __init__(self, device: UObject) -> None:
        """Become a part of a device.  Raises TypeError if the class of the device does not name this part."""
        self.device = device
        self.host = device.host
        self.variables, self.events = device.variables, device.events
        device.add_part(self)


def parts_of(kind: type) -> list[type[DevicePart]]:
    """The classes of the parts of a class of devices, those of its base classes first."""
    return [part for base in reversed(kind.__mro__) for part in vars(base).get("parts", ())]


def declaring_classes(kind: type) -> list[type]:
    """The classes that declare slots of a class of devices: its parts, its bases and itself, base classes first."""
    found: dict[type, None] = {}
    for base in reversed(kind.__mro__):
        for part in vars(base).get("parts", ()):
            found |= dict.fromkeys(reversed(part.__mro__))
        found[base] = None
    return list(found)
