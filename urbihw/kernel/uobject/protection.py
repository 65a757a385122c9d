"""Protection of the robot's slots: a program cannot take the robot from the other clients.

The ``stop`` of a robot may be an urbiscript function that also ends urbiscript behaviours, and it uses slots that
programs may change.  So the device that moves the robot is stopped first, natively; the urbiscript function runs after
it.
"""

from __future__ import annotations

from typing import Any, Final

from urbihw.kernel.runtime.code import Code, make_primitive
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.world import World
from urbihw.kernel.uobject.robot import PlatformRobot
from urbihw.kernel.uobject.uobject import UObjectFace

ROBOT: Final = "robot"
STOP: Final = "stop"
SLOTS: Final = (STOP, "estop")


def protect_robot(device: PlatformRobot, slot: str) -> None:
    """Protect a robot's device (``slot`` of Global), ``robot``, and their ``stop`` functions against removal,
    replacement and hiding.

    It must be called after the files that set these slots up.
    """
    world: World = device.host.world
    record = world.record
    record.protect(world.lobby_proto, slot, ROBOT)
    robot = world.global_.slots.get(ROBOT)
    for obj in (device.face, robot):
        if isinstance(obj, Obj):
            _stop_natively_first(world, device, obj)
            record.protect(obj, *SLOTS)


def _stop_natively_first(world: World, device: PlatformRobot, obj: Obj) -> None:
    holder: Any = obj.find(STOP)
    if holder is None:
        return
    usual = holder.slots[STOP]
    if isinstance(holder, UObjectFace) and not isinstance(usual, Code):
        return  # ``robot`` may be the device itself.
    # A promise of the robot API looks for another slot of this name and would find this function: keep the original.
    usual = getattr(usual, "getter", None) or usual

    def stop(this: Any) -> Any:
        """Stop now; commands given afterwards move the robot again."""
        device.stop()
        return world.invoke(usual, this, (), STOP)

    native = make_primitive(world, STOP, stop, 0, 0)
    # The robot may have come after the snapshot of the library.
    world.record.adopt(lambda: world.ops.put_slot(obj, STOP, native))
