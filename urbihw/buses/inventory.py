"""The devices on a wire beside those that the settings expect: what is missing, unexpected, of another kind.

The engine shows it every message of its driver; the result is in the state of the control socket, so that it can be
judged while the interpreter is busy.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from urbihw.buses.messages import DeviceState, Difference, Differences, ExpectedDevice, Found, FromWorker, GuestsGone


class Inventory:
    """Compares ``expected`` with the devices of ``Found`` (``id``, ``name`` of the model, ``firmware``).

    A device that is lost is missing.  Without expected devices there are no differences.
    """

    def __init__(self, expected: Sequence[ExpectedDevice]) -> None:
        self._expected = {each.id: each for each in expected}
        self._found: dict[int, tuple[str, str]] = {}
        self._lost: set[Any] = set()
        self._differences: Differences | None = None

    def hear(self, message: FromWorker) -> Differences | None:
        """Return the differences if this message has changed them, and None otherwise."""
        match message:
            case _ if not self._expected:
                return None
            case Found():
                for each in message.devices:
                    self._found[each.id] = each.name, str(each.firmware)
                    self._lost.discard(each.id)
            case GuestsGone():
                for number in message.devices:
                    self._found.pop(number, None)
            case DeviceState(new="lost"):
                self._lost.add(message.device)
            case DeviceState(new="back"):
                self._lost.discard(message.device)
            case _:
                return None
        before, self._differences = self._differences, self._compare()
        return None if self._differences == before else self._differences

    def state_fields(self) -> dict[str, Any]:
        """Return the fields of the state of the control socket (docs/safety.md)."""
        now = self._differences or self._compare()
        return {
            "expected": [_fields(each.id, each.name, expected=_kind(each)) for each in self._expected.values()],
            "missing": _rows(now.missing),
            "unexpected": _rows(now.unexpected),
            "other": _rows(now.other),
        }

    def _compare(self) -> Differences:
        there = {number: kind for number, kind in self._found.items() if number not in self._lost}
        missing, other = [], []
        for number, wanted in self._expected.items():
            if number not in there:
                missing.append(Difference(number, wanted.name, _kind(wanted)))
            elif not _fits(wanted, *there[number]):
                other.append(Difference(number, wanted.name, _kind(wanted), _words(*there[number])))
        unexpected = [
            Difference(number, "", "", _words(*kind))
            for number, kind in sorted(there.items())
            if self._expected and number not in self._expected
        ]
        return Differences(tuple(missing), tuple(unexpected), tuple(other))


def _fits(wanted: ExpectedDevice, model: str, firmware: str) -> bool:
    return wanted.model in ("", model) and wanted.firmware in ("", firmware)


def _kind(wanted: ExpectedDevice) -> str:
    return _words(wanted.model or "any model", wanted.firmware)


def _words(model: str, firmware: str) -> str:
    return f"{model}, firmware {firmware}" if firmware else model


def _rows(differences: Iterable[Difference]) -> list[dict[str, Any]]:
    return [_fields(each.id, each.name, expected=each.expected, found=each.found) for each in differences]


def _fields(id_: int, name: str, **kinds: str) -> dict[str, Any]:
    return {"id": id_, "name": name, **kinds}
