"""The API of device writers: the UObject API of the manual, in Python.

::

    class Servo(UObject):
        val = owned()                       # UBindVar and UOwned
        gain = variable(1.0)                # UBindVar

        @function                           # UBindFunction
        def init(self, id: int) -> None:
            self.notify_change(self.val, self.moved)

        def moved(self) -> None: ...

``host.register(Servo)`` makes the urbiscript class ``Servo``; ``Servo.new(3)`` makes the Python object and the
urbiscript object and calls ``init(3)``.  The same class also runs in a process of its own (``urbihw.remote``).  Reading
order: ``uvar`` (a variable with an owner, on ``hooked``, a slot with a device behind it), ``declarations`` and
``uobject`` (the base class), ``values`` (checks of written values), ``functions`` and ``threads`` (its methods),
``part`` (devices of several parts), ``motion`` (who may move a robot) and
``arming`` (what may after a release), ``effector`` (the variables that move it),
``host`` (the kernel as a platform sees it), ``robot`` (a platform as the daemon sees it), ``natives`` (the urbiscript
side).  Devices of other processes are in ``uremote``.

Beside them: ``callback`` and ``convert`` (handlers and their arguments), ``uvalue`` and ``binary`` (values of both
sides), ``uevent``, ``timers``, ``modules`` (files with devices), ``registry`` (all devices of a kernel), ``stats``,
``protection`` (no program can take the robot away), ``errors`` (kinds of failure).

May import ``runtime`` and ``sched``.
"""

from urbihw.kernel.uobject.binary import UBinary, UImage, USound
from urbihw.kernel.uobject.declarations import event, function, owned, reading, threaded, variable
from urbihw.kernel.uobject.effector import Effector, EffectorDevice
from urbihw.kernel.uobject.errors import BadConfig, DeviceError, Gone, NotReady
from urbihw.kernel.uobject.host import Host
from urbihw.kernel.uobject.motion import Motion, Origin
from urbihw.kernel.uobject.part import DevicePart
from urbihw.kernel.uobject.robot import Opened, PlatformRobot, RobotSettings, not_ended
from urbihw.kernel.uobject.threads import (
    LOCK_CLASS,
    LOCK_FUNCTION,
    LOCK_INSTANCE,
    LOCK_MODULE,
    LOCK_NONE,
    Lock,
)
from urbihw.kernel.uobject.uevent import UEvent
from urbihw.kernel.uobject.uobject import UObject, UObjectHub
from urbihw.kernel.uobject.uvalue import NIL
from urbihw.kernel.uobject.uvar import UVar
from urbihw.kernel.uobject.values import finite_number, finite_numbers, number, set_range

__all__ = [
    "LOCK_CLASS",
    "LOCK_FUNCTION",
    "LOCK_INSTANCE",
    "LOCK_MODULE",
    "LOCK_NONE",
    "NIL",
    "BadConfig",
    "DeviceError",
    "DevicePart",
    "Effector",
    "EffectorDevice",
    "Gone",
    "Host",
    "Lock",
    "Motion",
    "NotReady",
    "Opened",
    "Origin",
    "PlatformRobot",
    "RobotSettings",
    "UBinary",
    "UEvent",
    "UImage",
    "UObject",
    "UObjectHub",
    "USound",
    "UVar",
    "event",
    "finite_number",
    "finite_numbers",
    "function",
    "not_ended",
    "number",
    "owned",
    "reading",
    "set_range",
    "threaded",
    "variable",
]
