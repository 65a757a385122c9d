"""One device as found on the bus."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import field
from functools import cached_property

from urbihw.buses.servos.item import ControlTable, Mode
from urbihw.buses.servos.tables import table_for
from urbihw.frozen import frozen


@frozen(slots=False)
class ServoDevice:
    """The description of a device, as it was read.

    Attributes:
        id: on the bus.
        model: number, 0 when it answers pings only (status return level 0).
        firmware: version, 0 when unknown.
        protocol: 1, 2 or `status.FEETECH`.
        setup: the values of `ControlTable.setup_items` that could be read.
    """

    id: int
    model: int
    firmware: int
    protocol: int
    setup: Mapping[str, int] = field(default_factory=dict)

    @cached_property
    def table(self) -> ControlTable | None:
        """Its control table, for an unknown model the few rows known; None for a device that has not told its model."""
        return table_for(self.model, self.protocol) if self.model else None

    @cached_property
    def mode(self) -> Mode | None:
        """Its operating mode; None for a sensor, an unknown model, and when it could not be read."""
        table = self.table
        if table is None or not all(name in self.setup for name in table.mode_items):
            return None
        return table.mode_of(self.setup)

    @property
    def is_known(self) -> bool:
        """False for a device that is only expected and has never answered."""
        return self.model != 0 or bool(self.setup)

    @property
    def is_complete(self) -> bool:
        """Whether its model and all set-up items of the model could be read."""
        table = self.table
        return self.model != 0 and (table is None or all(name in self.setup for name in table.setup_items))

    @property
    def answers_writes(self) -> bool:
        """False when its status return level (Feetech: response level) disables answers to writes."""
        return self.setup.get("status_return_level", 2) >= 2 and self.setup.get("response_level", 1) >= 1

    @property
    def name(self) -> str:
        """Name of the model, or its number."""
        models = {} if self.table is None else self.table.models
        return models.get(self.model, f"unknown model {self.model}")


@frozen
class DeviceInfo:
    """The description of a device in a worker's `Found`.

    Attributes:
        id: on the bus.
        model: number.
        name: of the model.
        family: its control table ("AX-12", ...), "" for an unknown model.
        firmware: version.
        protocol: 1, 2 or `status.FEETECH`.
        mode: name of the operating mode, "" if there is none.
    """

    id: int
    model: int
    name: str
    family: str
    firmware: int
    protocol: int
    mode: str


@frozen(slots=False)
class ServoScan:
    """Outcome of a scan.

    Attributes:
        devices: in order of id.
        conflicts: ids that more than one device answers to; they are not in `devices`.
    """

    devices: tuple[ServoDevice, ...]
    conflicts: tuple[int, ...] = ()


def describe_devices(devices: Iterable[DeviceInfo]) -> str:
    """Return models, ids and firmware of the devices of a robot, in a few words."""
    kinds: dict[tuple[str, int], list[int]] = {}
    for info in devices:
        kinds.setdefault((info.name, info.firmware), []).append(info.id)
    return ", ".join(
        f"{len(ids)} {name} (id {' '.join(map(str, sorted(ids)))}, firmware {firmware})"
        for (name, firmware), ids in kinds.items()
    )


def same_kind(before: DeviceInfo | None, now: DeviceInfo) -> bool:
    """Return whether a device has the model and the firmware that it had before."""
    return before is not None and (before.model, before.firmware) == (now.model, now.firmware)


def info_of(device: ServoDevice) -> DeviceInfo:
    """Return the description of a device for the daemon."""
    table, mode = device.table, device.mode
    return DeviceInfo(
        device.id,
        device.model,
        device.name,
        table.name if table is not None and table.models else "",
        device.firmware,
        device.protocol,
        "" if mode is None else mode.name,
    )
