"""Modules that programs offer to NAOqi, and the calls that come to them (manual, "Writing NaoQi modules in urbi").

A method runs in a job of the robot, not of a connection: what it moves has no lease, and its ``echo`` is lost.
The job is stopped when its caller does not wait any more, and when the link is lost.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, Final

from urbihw.buses import messages as m
from urbihw.kernel.uobject import UBinary, UObject, event, function
from urbihw.platforms.channel import DeviceChannel
from urbihw.platforms.devicelog import DeviceLog
from urbihw_nao import words
from urbihw_nao.module_part import CALL, BoundMethod
from urbihw_nao.qimessaging.serving import shorten_error

SLOT: Final = "naoModules"
"""The name of the only instance in Global."""
DEEPEST: Final = 16
"""Lists and dictionaries in each other, of a result."""
_NAME: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,99}")


class NaoModules(UObject):
    """All modules.  ``ALModule`` in ``almodule.u`` is what programs see."""

    slot_words = words.MODULES

    offered = event()

    def init(self, channel: DeviceChannel, log: DeviceLog) -> None:
        """Made by the robot."""
        self._channel, self._log = channel, log
        self._modules: dict[str, Any] = {}
        self._told: dict[str, tuple[str, tuple[BoundMethod, ...]]] = {}
        self._running: set[int] = set()
        self._count = 0

    # ---------------------------------------------------------------- what urbiscript calls

    @function
    def offer(self, name: str, module: Any, description: str, methods: list[Any]) -> int:
        """Offer a module, or change it; ``offered`` then has this number, and why it was refused, or "".

        ``methods`` are the arguments of ``bindUrbiMethod``, one list for each.
        """
        if not _NAME.fullmatch(name):
            raise ValueError(f"a module cannot have the name {name!r}: letters, digits and _ only")
        if self._modules.get(name, module) is not module:
            raise ValueError(
                f'there is a module {name} already: choose another name, or {SLOT}.withdraw("{name}") first'
            )
        told = description, tuple(_bound_method(row) for row in methods)
        before = self._modules.get(name), self._told.get(name)
        self._modules[name], self._told[name] = module, told
        self._count += 1
        number = self._count

        def answered(reply: m.Reply) -> None:
            if reply.error and before[1] is None:
                self._forget(name)
            self.offered.emit(float(number), reply.error)

        self._channel.send_request("serve", name, answered, value=(*told, False))
        return number

    @function
    def withdraw(self, name: str) -> None:
        """Offer a module no more."""
        self._forget(name)
        self._channel.send_request("withdraw", name, lambda reply: None)

    @function
    def answer(self, number: int, good: bool, outcome: list[Any]) -> None:
        """A call is over: ``outcome`` has the result, nothing for void, or the error of one that is not ``good``."""
        self._running.discard(number)
        value = outcome[0] if outcome else None
        try:
            told = good, _plain(value) if good else shorten_error(str(value))
        except ValueError as error:
            told = False, str(error)
        self._channel.send_request("answer", number, lambda reply: None, value=told)

    # ---------------------------------------------------------------- what the robot calls

    def offer_again(self) -> None:
        """The robot was found again, perhaps by a new worker."""
        for name, told in self._told.items():

            def answered(reply: m.Reply, name: str = name) -> None:
                if reply.error:
                    self._log.warning("module %s: %s", name, reply.error)

            self._channel.send_request("serve", name, answered, value=(*told, True))

    def handle(self, message: m.DeviceReport) -> None:
        """A call has come, or its answer is no longer awaited."""
        if message.what != CALL:
            self._cancel(message.value)
            return
        number, name, method, arguments = message.value
        module = self._modules.get(name)
        if module is None:
            self.answer(number, False, [f"there is no module {name}"])
            return
        self._running.add(number)
        self.host.order(SLOT, "run", float(number), module, method, arguments)

    def cancel_all(self) -> None:
        """The link is lost: no answer is awaited."""
        for number in sorted(self._running):
            self._cancel(number)

    def _cancel(self, number: int) -> None:
        if number in self._running:
            self._running.discard(number)
            self.host.call(SLOT, "cancel", float(number))

    def _forget(self, name: str) -> None:
        self._modules.pop(name, None)
        self._told.pop(name, None)


def _bound_method(row: Any) -> BoundMethod:
    """The arguments of ``bindUrbiMethod``.  Raises ValueError."""
    name, description, parameters, result = row
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise ValueError(f"a method cannot have the name {name!r}")
    pairs = tuple(_pair(each, "each parameter") for each in _list(parameters, "the parameters"))
    return BoundMethod(name, str(description), pairs, _pair(result, "the result") if result else ("", ""))


def _list(value: Any, what: str) -> Sequence[Any]:
    if not isinstance(value, list | tuple):
        raise ValueError(f"{what}: write [[name, description], ...]")
    return value


def _pair(value: Any, what: str) -> tuple[str, str]:
    if not isinstance(value, list | tuple) or len(value) != 2 or not all(isinstance(each, str) for each in value):
        raise ValueError(f"{what}: write [name, description]")
    return value[0], value[1]


def _plain(value: Any, depth: int = 0) -> Any:
    """A result as it can be sent.  Raises ValueError."""
    if depth > DEEPEST:
        raise ValueError("the result cannot be sent: it is too deep")
    if value is None or isinstance(value, bool | int | float | str | bytes):
        return value
    if isinstance(value, UBinary):
        return bytes(value.data)
    if isinstance(value, list | tuple):
        return [_plain(each, depth + 1) for each in value]
    if isinstance(value, dict):
        return {key: _plain(each, depth + 1) for key, each in value.items()}
    raise ValueError("the result cannot be sent: only numbers, Strings, Booleans, Lists, Dictionaries and Binaries can")
