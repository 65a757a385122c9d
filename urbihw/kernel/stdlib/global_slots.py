"""Global: slots visible everywhere.  Its prototypes make those of Math and System visible, too."""

from __future__ import annotations

from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import CallMessage, String
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.support import field, native
from urbihw.kernel.value import Value

TABLE = Table("Global")
PROTOS = {
    "Global": ("uobjects", "Math", "System", "Object"),
    # The manual names both without slots: values and declarations of devices need no object here.
    "UValue": ("Object",),
    "external": ("Object",),
}

NOTES = {
    "Global.evaluate": "A String assigned to it runs as a program; a read returns the value of the last statement.",
    "UValue": "Named in the manual without slots: values are passed to and from devices without conversion.",
    "external": (
        "Named by the manual: what declares devices of other processes.  The statement external is what speaks to "
        "it."
    ),
    "UObject": "A device: an object whose slots are variables and functions of Python or of another process.",
    "UVar": "A variable of a device; a slot that holds one reads and writes its value.",
    "UObject.__uobjectName": "The name under which the device is a slot of uobjects.",
    "Localization": "The position of one of several like components of a robot: front, left, x.",
    "Global.uobjects": "All devices, as slots by their unique names.",
    "Global.uobjects_handle": "An object for callbacks of UVars that remain as long as the server runs.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


@TABLE.primitive("methodToFunction")
def method_to_function(world: World, this: Value, name: str) -> Value:
    """A function that calls the method ``name`` of its first argument with the remaining arguments."""
    return native(world, name, lambda _, target, *args: world.send(target, name, *args), 1, -1)


@TABLE.lazy("isdef", least=1, most=1)
def isdef(world: World, message: CallMessage) -> bool:
    """Whether a name, or a path of names joined by dots, is defined; no function on the path is called."""
    node = message.args[0].node
    names: list[str] = []
    while node is not None and type(node).__name__ == "Call":
        names.append(node.name)
        node = node.target
    if node is not None or not names:
        raise errors.primitive("expected a qualified identifier", "isdef")
    names.reverse()
    value = message.sender
    for name in names:
        world.recorder.read(value, name)
        if world.peek_obj(value).find(name) is None:
            return False
        value = world.get_slot(value, name)
    return True


def install(world: World, programs: Any) -> None:
    """Install ``evaluate``: an assignment of a program text to it runs the text, a read returns the value of its last
    statement.
    """
    last = [world.void]

    def write(this: Value, source: Value) -> None:
        if not isinstance(source, String):
            raise world.type_error(1, source, "String", "evaluate")
        lobby = world.scheduler.running().context
        try:
            last[0] = programs.evaluate(source.s, lobby or world.global_)
        except Exception as error:  # the writer continues, as with any variable that notifies subscribers
            if lobby is None:
                raise
            lobby.output.line("!!! Exception caught while processing notify on Global.evaluate:", "error")
            lobby.report(error)

    field(world, world.global_, "evaluate", lambda this: last[0], write)
