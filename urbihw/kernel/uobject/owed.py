"""The robot as everybody's: what no program can take from the others.

The ``stop`` of a robot may be a function of urbiscript, which also ends what urbiscript steers, and goes through slots
that programs may spoil.  So the device that moves the robot is stopped first, natively, and then the rest is done.
"""

from __future__ import annotations

from typing import Any, Final

from urbihw.kernel.runtime.code import Code, make_primitive
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.world import World
from urbihw.kernel.uobject.robot import Robot
from urbihw.kernel.uobject.uobject import UObjectFace

ROBOT: Final = "robot"
STOP: Final = "stop"
SLOTS: Final = (STOP, "estop")


def owe_robot(device: Robot, slot: str) -> None:
    """Let no program remove, replace or hide a robot's device (``slot`` of Global), ``robot``, or how they are stopped.

    To be called when they are what they should be: after the files that set them up.
    """
    world: World = device.host.world
    record = world.record
    record.owe(world.lobby_proto, slot, ROBOT)
    robot = world.global_.slots.get(ROBOT)
    for obj in (device.face, robot):
        if isinstance(obj, Obj):
            _stop_natively_first(world, device, obj)
            record.owe(obj, *SLOTS)


def _stop_natively_first(world: World, device: Robot, obj: Obj) -> None:
    holder: Any = obj.find(STOP)
    if holder is None:
        return
    usual = holder.slots[STOP]
    if isinstance(holder, UObjectFace) and not isinstance(usual, Code):
        return  # that of the device itself
    # A promise of the robot API would look for another slot of the name and find the one made here: what keeps it.
    usual = getattr(usual, "getter", None) or usual

    def stop(this: Any) -> Any:
        """Stop now; what is begun afterwards moves the robot again."""
        device.stop()
        return world.invoke(usual, this, (), STOP)

    world.ops.put(obj, STOP, make_primitive(world, STOP, stop, 0, 0))
