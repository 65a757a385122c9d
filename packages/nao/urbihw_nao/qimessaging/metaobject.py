"""What a service offers: methods with their signatures, signals, properties; and the choice of an overload."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from typing import Any, Self

from urbihw.buses.errors import BadFrame, BadValue
from urbihw.frozen import frozen
from urbihw_nao.qimessaging.checked import LONGEST_LINE, is_name, show_text, to_row, to_whole
from urbihw_nao.qimessaging.signatures import parse
from urbihw_nao.qimessaging.values import mismatch

FIRST_USER_UID = 100
"""Methods below are those of the protocol, the same for all objects."""


@frozen
class Method:
    """A method of a service; the signatures of its result and of all its parameters together."""

    uid: int
    name: str
    returns: str
    parameters: str
    description: str = ""

    def __str__(self) -> str:
        return f"{self.name}{self.parameters}"


@frozen
class QiSignal:
    """A signal or property of a service; a signal's signature is that of all its values together."""

    uid: int
    name: str
    signature: str


@frozen(slots=False)
class MetaObject:
    """What an object offers: methods by name, each a list of overloads; signals and properties by name."""

    methods: Mapping[str, Sequence[Method]]
    signals: Mapping[str, QiSignal]
    properties: Mapping[str, QiSignal]

    @classmethod
    def from_value(cls, value: Any) -> Self:
        """The description in a decoded answer to ``metaObject``.

        Members with an invalid signature or name are left out.  Raises BadFrame for another form.
        """
        rows, signals, properties = to_row(value, 3)[:3]
        methods: dict[str, list[Method]] = {}
        for row in _rows(rows):
            uid, returns, name, parameters, description = to_row(row, 5)[:5]
            if is_name(name) and _is_type(returns) and _is_type(parameters):
                method = Method(_to_number(uid), name, returns, parameters, str(description))
                methods.setdefault(name, []).append(method)
        return cls(methods, _to_signals(signals), _to_signals(properties))

    def names(self) -> list[str]:
        """The methods that are the service's own, sorted."""
        return sorted(name for name, rows in self.methods.items() if any(row.uid >= FIRST_USER_UID for row in rows))

    def choose(self, service: str, name: str, arguments: Sequence[Any]) -> Method:
        """The overload that fits the arguments best.  Raises BadValue, naming what there is."""
        overloads = self.methods.get(name)
        if not overloads:
            near = get_close_matches(name, self.methods, 1)
            hint = f"; did you mean {near[0]}?" if near else ""
            raise BadValue(f"{show_text(service)} has no method {show_text(name)}{hint}")
        fits = [(cost, method) for method in overloads if (cost := _cost(method, arguments)) is not None]
        if not fits:
            known = show_text(" or ".join(map(str, overloads)), LONGEST_LINE)
            raise BadValue(f"{service}.{name} does not take these {len(arguments)} arguments; it takes {known}")
        return min(fits, key=lambda row: row[0])[1]


def _rows(value: Any) -> Iterable[Any]:
    if not isinstance(value, Mapping):
        raise BadFrame("the offers of a service are not in a map")
    return value.values()


def _to_signals(value: Any) -> dict[str, QiSignal]:
    rows = [to_row(row, 3)[:3] for row in _rows(value)]
    return {name: QiSignal(_to_number(uid), name, sign) for uid, name, sign in rows if is_name(name) and _is_type(sign)}


def _to_number(uid: Any) -> int:
    return to_whole(uid, 0, 0xFFFFFFFF)


def _is_type(signature: Any) -> bool:
    if not isinstance(signature, str):
        return False
    try:
        parse(signature)
    except BadFrame:
        return False
    return True


def _cost(method: Method, arguments: Sequence[Any]) -> float | None:
    """How badly the arguments fit, summed; None if they do not."""
    parts = parse(method.parameters).parts
    if len(parts) != len(arguments):
        return None
    costs = [mismatch(part, each) for part, each in zip(parts, arguments, strict=True)]
    return None if None in costs else sum(cost for cost in costs if cost is not None)
