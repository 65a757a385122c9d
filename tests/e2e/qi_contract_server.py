"""A simulated Nao with one service more, for ``test_qi_contract``: ``fake`` or ``libqi``, until its input ends."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

from urbihw_nao_fakes.device import Nao
from urbihw_nao_fakes.endpoint import NaoEndpoint
from urbihw_nao_fakes.services import Failed, Later, Property, Service, Signal, method


class Contract(Service):
    """Methods of all kinds."""

    name = "Contract"
    moved = Signal("moved", "(sf)")
    level = Property("level", "i", 3)

    def __init__(self, clock: Callable[[], float]) -> None:
        super().__init__()
        self._clock = clock
        self.last: list[Any] = []

    @method("echo", "(m)", "m")
    def echo(self, value: Any) -> Any:
        """The same."""
        return value

    @method("sum", "(iIlLfd)", "d")
    def add(self, *numbers: float) -> float:
        """All numbers."""
        return float(sum(numbers))

    @method("both", "(bs)", "(bs)")
    def both(self, flag: bool, text: str) -> tuple[bool, str]:
        """The same."""
        return flag, text

    @method("reverse", "(r)", "r")
    def reverse(self, data: bytes) -> bytes:
        """The last byte first."""
        return bytes(data)[::-1]

    @method("image", "()", "(iir)")
    def image(self) -> tuple[int, int, bytes]:
        """Width, height, bytes that are no text."""
        return 2, 1, bytes([255, 0, 128, 1, 2, 254])

    @method("lists", "([i][[f]]{si})", "([i][[f]]{si})")
    def lists(self, *values: Any) -> tuple[Any, ...]:
        """The same."""
        return values

    @method("go", "(f)", "s")
    def go(self, _: float) -> str:
        """An overload."""
        return "one"

    @method("go", "(ff)", "s")
    def go_there(self, *_: float) -> str:
        """An overload."""
        return "two"

    @method("go", "(fs)", "s")
    def go_to_name(self, *_: Any) -> str:
        """An overload."""
        return "name"

    @method("boom")
    def boom(self) -> None:
        """Fails as NAOqi does: the text, then lines of its source."""
        raise Failed("Contract: no such joint\n\n    at /home/nao/contract.cpp:17")

    @method("nap", "(f)", "s")
    def nap(self, seconds: float) -> Later:
        """The answer comes after some seconds."""
        end = self._clock() + seconds
        return Later(lambda: self._clock() >= end, "rested")

    @method("fire", "(sf)")
    def fire(self, name: str, value: float) -> None:
        """Send the signal."""
        self.emit(self.moved, name, value)

    @method("note", "(m)")
    def note(self, value: Any) -> None:
        """Remember a value."""
        self.last.append(value)

    @method("notes", "()", "m")
    def notes(self) -> list[Any]:
        """What was remembered, and no longer is."""
        last, self.last = self.last, []
        return last


def main(kind: str) -> None:
    """Serve in a thread until the input ends."""
    robot = Nao()
    robot.server.add_service(Contract(robot.read_clock))
    end: Any
    if kind == "libqi":
        from urbihw_nao_fakes.libqi import LibqiEndpoint

        end = LibqiEndpoint(robot)
    else:
        end = NaoEndpoint(robot)
    with end:
        end.start()
        print(end.url, flush=True)
        sys.stdin.read()


if __name__ == "__main__":
    main(sys.argv[1])
