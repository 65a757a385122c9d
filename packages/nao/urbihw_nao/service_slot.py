"""A slot that is a setting of a service of NAOqi: written by one method, read by another one at each connection."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Any

from urbihw.buses.messages import Reply
from urbihw.frozen import frozen
from urbihw.kernel.uobject import UObject, UVar, finite_number
from urbihw.platforms.channel import DeviceChannel
from urbihw.platforms.devicelog import DeviceLog


@frozen(slots=False)
class Setting:
    """A setting of a service.

    Attributes:
        service: its name.
        getter, setter: a method and its first arguments; the setter gets the value behind them.
        to_robot: converts a value of urbiscript; raises ValueError for an invalid one.
        from_robot: converts what the getter returns; raises ValueError, TypeError.
    """

    service: str
    getter: Sequence[Any]
    setter: Sequence[Any]
    to_robot: Callable[[Any], Any] = finite_number
    from_robot: Callable[[Any], Any] = float


class ServiceSlot:
    """Connects the variable of an object with a setting."""

    def __init__(self, owner: UObject, var: UVar, setting: Setting, channel: DeviceChannel, log: DeviceLog) -> None:
        self._var, self._setting, self._channel, self._log = var, setting, channel, log
        self._is_there = False
        owner.notify_change(var, self._write)

    def connect(self, services: Collection[str]) -> None:
        """The robot was found, with these services: read the setting."""
        self._is_there = self._setting.service in services
        if self._is_there:
            method, *first = self._setting.getter
            self._channel.call(self._setting.service, method, first, self._show)

    def _show(self, reply: Reply) -> None:
        if not reply.ok:
            return  # a robot without this setting; a write tells so
        try:
            self._var.sense(self._setting.from_robot(reply.value))
        except (ValueError, TypeError):
            self._log.warning("%s: %s answers %.40r", self._setting.service, self._setting.getter[0], reply.value)

    def _write(self) -> None:
        setting = self._setting
        if not self._is_there:
            raise ValueError(f"this robot has no {setting.service}")
        value = self._var.value
        method, *first = setting.setter
        arguments = [*first, setting.to_robot(value)]
        origin = self._channel.origin()

        def done(reply: Reply) -> None:
            if not reply.ok:
                self._log.warning("%s: not set: %s", self._var.name, reply.error)
                origin.warn(f"{self._var.name} is not set: {reply.error}")
            self.connect((setting.service,))

        self._channel.call(setting.service, method, arguments, done)
        self._var.sense(value)
