"""A real libqi with one service, until its input ends: a witness for ``test_nao_libqi``."""

from __future__ import annotations

import sys
from typing import Any

import qi


class Motion:
    """A service."""

    def __init__(self) -> None:
        self.moved = qi.Signal("(sd)")
        self.level = qi.Property("i")
        self._last: tuple[Any, ...] = ()

    @qi.bind(qi.List(qi.Float), [qi.Dynamic, qi.Bool], "getAngles")  # type: ignore[untyped-decorator]
    def get_angles(self, names: Any, sensors: bool) -> list[float]:
        return [0.5] * (len(names) if isinstance(names, list) else 1)

    @qi.bind(qi.Void, [qi.Float] * 3, "moveTo")  # type: ignore[untyped-decorator]
    def move_to(self, x: float, y: float, turn: float) -> None:
        self._last = ("three", x, y, turn)

    @qi.bind(qi.Void, [qi.Float] * 4, "moveTo")  # type: ignore[untyped-decorator]
    def move_to_in(self, x: float, y: float, turn: float, time: float) -> None:
        self._last = ("four", x, y, turn, time)

    def which(self) -> list[Any]:
        return list(self._last)

    def echo(self, value: Any) -> Any:
        return value

    def boom(self) -> None:
        raise ValueError("no such joint")

    def fire(self) -> None:
        self.moved("HeadYaw", 0.25)

    @qi.bind("(iiiiiiriffff)", [])  # type: ignore[untyped-decorator]
    def image(self) -> tuple[Any, ...]:
        return 2, 1, 3, 11, 0, 0, bytes([255, 0, 128, 1, 2, 3]), 0, 0.0, 0.0, 0.0, 0.0


session = qi.Session()
session.listenStandalone("tcp://127.0.0.1:0")
session.registerService("ALMotion", Motion())
print(session.endpoints()[0], flush=True)
sys.stdin.read()
# Without this the process may crash at its end.
session.close()
