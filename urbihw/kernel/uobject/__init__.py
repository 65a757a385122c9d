"""The API of device writers: the manual's chapter 3 in Python dress.

::

    class Servo(UObject):
        val = owned()                       # UBindVar and UOwned
        gain = variable(1.0)                # UBindVar

        @function                           # UBindFunction
        def init(self, id: int) -> None:
            self.notify_change(self.val, self.moved)

        def moved(self) -> None: ...

``host.register(Servo)`` makes the urbiscript class ``Servo``; ``Servo.new(3)`` makes an instance of both worlds and
calls ``init(3)``.  Reading order: ``uvar`` (a variable with an owner), ``uobject`` (the base class), ``host`` (what a
platform holds of the kernel), ``robot`` (what the daemon holds of a platform), ``natives`` (how urbiscript sees it).
May import ``runtime`` and ``sched``.
"""

from urbihw.kernel.uobject.errors import BadConfig, DeviceError, Gone, NotReady
from urbihw.kernel.uobject.host import Host
from urbihw.kernel.uobject.robot import Opened, Robot, RobotSettings
from urbihw.kernel.uobject.uobject import UEvent, UObject, event, function, owned, reading, variable
from urbihw.kernel.uobject.uvar import UVar

__all__ = [
    "BadConfig",
    "DeviceError",
    "Gone",
    "Host",
    "NotReady",
    "Opened",
    "Robot",
    "RobotSettings",
    "UEvent",
    "UObject",
    "UVar",
    "event",
    "function",
    "owned",
    "reading",
    "variable",
]
