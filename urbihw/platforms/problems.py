"""What is wrong with a robot, as the slot ``problems`` shows it: devices that differ from the expected ones, devices
that cannot be used, and lost parts on wires of their own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from urbihw.buses import messages as m
from urbihw.kernel.uobject import DevicePart, UObject, reading
from urbihw.platforms.devicelog import DeviceEvent, DeviceLog

_KINDS: Final = tuple(
    DeviceEvent(f"{kind}: {{who}}", f"{kind}: {{who}}", kind) for kind in ("missing", "unexpected", "of another kind")
)
"""How devices differ from the expected ones; a bus that is switched on tells them one after the other."""
CallLater = Callable[[float, Callable[[], None]], Callable[[], None]]


class ProblemReport(DevicePart):
    """The problems of one robot."""

    problems = reading([])

    def __init__(
        self, device: UObject, send: Callable[[m.ToWorker], None], log: DeviceLog, call_later: CallLater,
        unusable: Callable[[], list[str]], unarmed: Callable[[], str],
    ) -> None:  # fmt: skip
        """``send`` passes a message to the worker; ``call_later`` calls a function after some seconds, and returns one
        that cancels this; ``unusable`` returns a line for each device that is not used, and
        ``unarmed`` one for the programs that wait for ``rearm``, "" if there are none.
        """
        super().__init__(device)
        self._send, self._log, self._unusable, self._unarmed = send, log, unusable, unarmed
        self._differences: list[str] = []
        self._lost_parts: dict[str, str] = {}
        self._call_later = call_later
        self._looser = ""
        self._forget_looser: Callable[[], None] = lambda: None
        self._worker_trouble = ""

    def show(self) -> None:
        """Show whether the worker answers, which programs wait for ``rearm``, which limits were raised, what differs
        from the expected devices, and which devices and parts cannot be used.
        """
        parts = [f"{name}: {reason}" for name, reason in self._lost_parts.items()]
        waiting = [each for each in (self._worker_trouble, self._unarmed(), self._looser) if each]
        self.problems.sense([*waiting, *self._differences, *self._unusable(), *parts])

    def show_unarmed(self) -> None:
        """Show and log which programs wait for ``rearm``: they have changed."""
        self.show()
        if waiting := self._unarmed():
            self._log.warning("%s", waiting)

    def show_looser(self, raised: list[str], all_raised: list[str], seconds: float) -> None:
        """Log which limits a reload of the settings has removed or raised, in words, and show all of the last
        ``seconds``.
        """
        self._looser = _in_words(all_raised)
        self.show()
        if raised:
            self._log.warning("%s", _in_words(raised))
            self._forget_looser()
            self._forget_looser = self._call_later(seconds, lambda: self.show_looser([], [], seconds))

    def show_worker(self, trouble: str) -> None:
        """Show that the worker does not answer, in words; "" when it does."""
        if trouble != self._worker_trouble:
            self._worker_trouble = trouble
            self.show()

    def show_part(self, name: str, reason: str) -> None:
        """Tell the health and ``problems`` that a part on a wire of its own is lost, a laser say; "" when it is not."""
        if self._lost_parts.get(name, "") == reason:
            return
        self._lost_parts.pop(name, None)
        if reason:
            self._lost_parts[name] = reason
        self._send(m.Unusable(name, reason))
        self.show()

    def tell_again(self) -> None:
        """Tell the lost parts to a worker that may be another one."""
        for name, reason in self._lost_parts.items():
            self._send(m.Unusable(name, reason))

    def show_differences(self, message: m.Differences) -> None:
        """Show what differs from the expected devices, and log what is new in a line for each kind."""
        missing = [f"{each.name} (id {each.id})" for each in message.missing]
        unexpected = [f"id {each.id} ({each.found})" for each in message.unexpected]
        other = [f"{each.name} (id {each.id}) is {each.found}, not {each.expected}" for each in message.other]
        before = {*self._differences}
        shown = (
            [f"{each} missing" for each in missing],
            [f"{each} unexpected" for each in unexpected],
            other,
        )
        texts = [text for kind in shown for text in kind]
        self._differences = texts
        self.show()
        if before and not texts:
            self._log.info("all expected devices are there, and no others")
        for kind, devices, lines in zip(_KINDS, (missing, unexpected, other), shown, strict=True):
            for device, line in zip(devices, lines, strict=True):
                if line not in before:
                    self._log.log_event(kind, device)


def _in_words(limits: list[str]) -> str:
    return f"limits removed or raised by the settings: {'; '.join(limits)}" if limits else ""
