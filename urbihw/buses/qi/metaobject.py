"""What a service offers: methods with their signatures, signals, properties; and the choice of an overload."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, Self

from urbihw.buses.errors import BadFrame, BadValue
from urbihw.buses.qi.signatures import parse
from urbihw.buses.qi.values import mismatch

FIRST_USER_UID = 100
"""Methods below are those of the protocol, the same for all objects."""


@dataclass(frozen=True, slots=True)
class Method:
    """A method of a service; the signatures of its result and of all its parameters together."""

    uid: int
    name: str
    returns: str
    parameters: str
    description: str = ""

    def __str__(self) -> str:
        return f"{self.name}{self.parameters}"


@dataclass(frozen=True, slots=True)
class Signal:
    """A signal or property of a service; a signal's signature is that of all its values together."""

    uid: int
    name: str
    signature: str


@dataclass(frozen=True)
class MetaObject:
    """What an object offers: methods by name, each a list of overloads; signals and properties by name."""

    methods: Mapping[str, Sequence[Method]]
    signals: Mapping[str, Signal]
    properties: Mapping[str, Signal]

    @classmethod
    def from_value(cls, value: Any) -> Self:
        """The description in a decoded answer to ``metaObject``; members with a signature that is none are left out."""
        methods: dict[str, list[Method]] = {}
        for uid, returns, name, parameters, description, _, _ in value[0].values():
            if _is_type(returns) and _is_type(parameters):
                methods.setdefault(name, []).append(Method(uid, name, returns, parameters, description))
        signals, properties = (
            {row[1]: Signal(*row) for row in rows.values() if _is_type(row[2])} for rows in value[1:3]
        )
        return cls(methods, signals, properties)

    def names(self) -> list[str]:
        """The methods that are the service's own, sorted."""
        return sorted(name for name, rows in self.methods.items() if any(row.uid >= FIRST_USER_UID for row in rows))

    def choose(self, service: str, name: str, arguments: Sequence[Any]) -> Method:
        """The overload that fits the arguments best.  Raises BadValue, naming what there is."""
        overloads = self.methods.get(name)
        if not overloads:
            near = get_close_matches(name, self.methods, 1)
            hint = f"; did you mean {near[0]}?" if near else ""
            raise BadValue(f"{service} has no method {name}{hint}")
        fits = [(cost, method) for method in overloads if (cost := _cost(method, arguments)) is not None]
        if not fits:
            known = " or ".join(map(str, overloads))
            raise BadValue(f"{service}.{name} does not take these {len(arguments)} arguments; it takes {known}")
        return min(fits, key=lambda row: row[0])[1]


def _is_type(signature: str) -> bool:
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
