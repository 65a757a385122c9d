"""The driver of a Nao without a kernel, and its robot, in simulated time."""

from __future__ import annotations

from typing import Any, Self

from driver_rig import DriverRig

from urbihw.buses.messages import Reply
from urbihw_nao.driver import NaoDriver
from urbihw_nao.qimessaging.frames import CALL, POST, QiFramer
from urbihw_nao_fakes.body import Body
from urbihw_nao_fakes.device import Nao

TICK = DriverRig.tick


class Rig(DriverRig):
    """A driver, a robot, and how often each method was called."""

    driver_class = NaoDriver
    url = "pipe://robot?baud=100000000"
    driver: NaoDriver

    def __init__(self, robot: Nao | None = None, **options: Any) -> None:
        self.robot = Nao() if robot is None else robot
        self.asked = 0
        super().__init__(self.robot, options=options)
        self.end.on_open = self.robot.reconnect

    @property
    def body(self) -> Body:
        """The body of the robot."""
        return self.robot.body

    def receive(self, data: bytes, at: float) -> None:
        self.asked += sum(message.type in (CALL, POST) for message in QiFramer().feed(data))
        super().receive(data, at)

    def attach(self) -> Self:
        """Log in."""
        super().attach()
        self.driver.stop_what_moves()
        self.run(0.2)
        return self

    def order(self, item: str = "angle", /, **values: float) -> list[Any]:
        """Targets of joints."""
        return self.write({(name, item): value for name, value in values.items()})

    def request(self, verb: str, device: str, item: str = "", *arguments: Any, number: int = 1) -> list[Any]:
        """A request, and what it told within a second."""
        told = self.send_request(verb, device, item, arguments, number)
        return [each for each in [*told, *self.run(1.0)] if isinstance(each, Reply)]
