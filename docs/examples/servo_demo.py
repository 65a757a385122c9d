"""Serve the servomotor of servo.py with simulated motors: ``.venv/bin/python docs/examples/servo_demo.py [PORT]``."""

from __future__ import annotations

import asyncio
import sys

from servo import Servo

from urbihw.kernel import Kernel
from urbihw.kernel.server.loop import LoopDriver
from urbihw.kernel.server.tcp import Server


class Motors:
    """Three motors, 1 to 3, that are where they are told to be but for a little friction."""

    def __init__(self) -> None:
        self.positions = {1: 0.0, 2: 0.0, 3: 0.0}

    def initialize(self, id: int) -> bool:
        return id in self.positions

    def get_position(self, id: int) -> float:
        return self.positions[id]

    def set_position(self, id: int, position: float) -> None:
        self.positions[id] = position - 0.01

    def set_pid(self, id: int, p: float, i: float, d: float) -> None:
        print(f"motor {id}: gains {p:g} {i:g} {d:g}")


def register(kernel: Kernel) -> None:
    """Make the class known to urbiscript, as the slot ``Servo`` of Global."""
    Servo.hardware = Motors()
    kernel.host.register(Servo)


async def main(port: int) -> None:
    """Serve until shutdown."""
    over = asyncio.Event()
    kernel = Kernel()
    register(kernel)
    kernel.programs.shutdown = over.set
    driver = LoopDriver(kernel.scheduler)
    server = Server(driver, kernel.open_lobby)
    await server.listen("127.0.0.1", port)
    await over.wait()
    await server.close()
    driver.close()


if __name__ == "__main__":
    asyncio.run(main(int(sys.argv[1]) if len(sys.argv) > 1 else 54000))
