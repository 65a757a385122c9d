"""What a service of NAOqi is here: methods with their numbers and signatures, and signals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any


class Failed(Exception):
    """A method failed; the text goes to the caller."""


@dataclass(frozen=True)
class Later:
    """The result of a method that blocks: the answer comes when ``ready``, unless it is ``cancelled`` before."""

    ready: Callable[[], bool]
    value: Any = None


@dataclass(frozen=True)
class Method:
    """A method; ``run`` takes its arguments."""

    uid: int
    returns: str
    name: str
    takes: str
    run: Callable[..., Any]


@dataclass
class Service:
    """A service, or an object of one."""

    name: str
    methods: dict[int, Method] = field(default_factory=dict)
    signals: dict[int, tuple[str, str]] = field(default_factory=dict)

    def add(self, returns: str, name: str, takes: str, run: Callable[..., Any]) -> None:
        """One more method."""
        uid = 100 + len(self.methods) + len(self.signals)
        self.methods[uid] = Method(uid, returns, name, takes, run)

    def add_signal(self, name: str, signature: str) -> int:
        """One more signal; its number."""
        uid = 100 + len(self.methods) + len(self.signals)
        self.signals[uid] = name, signature
        return uid

    def meta(self) -> tuple[Any, ...]:
        """Its description."""
        methods: dict[int, Any] = {
            row.uid: (row.uid, row.returns, row.name, row.takes, "", [], "")
            for row in (*COMMON, *self.methods.values())
        }
        signals = {uid: (uid, name, signature) for uid, (name, signature) in self.signals.items()}
        return methods, signals, {}, self.name


def _nothing() -> None:
    return None


COMMON = (
    Method(0, "L", "registerEvent", "(IIL)", _nothing),
    Method(1, "v", "unregisterEvent", "(IIL)", _nothing),
    Method(3, "v", "terminate", "(I)", _nothing),
    Method(2, "({I(Issss[(ss)]s)}{I(Iss)}{I(Iss)}s)", "metaObject", "(I)", _nothing),
)
"""What all objects have."""


def as_list(value: Any) -> list[Any]:
    """One value, or several: NAOqi takes both."""
    return list(value) if isinstance(value, list | tuple) else [value]
