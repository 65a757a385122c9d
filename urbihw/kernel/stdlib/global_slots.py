"""Global: what everybody sees.  Its prototypes make Math and System visible everywhere, too."""

from __future__ import annotations

from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import CallMessage, String
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.support import field, native

TABLE = Table("Global")
PROTOS = {
    "Global": ("uobjects", "Math", "System", "Object"),
    # The manual names both and gives them no slots: values and declarations of devices need no object here.
    "UValue": ("Object",),
    "external": ("Object",),
}

NOTES = {
    "Global.evaluate": "Assigned a String, runs it as a program; read, gives the value of its last statement.",
    "UValue": "Named by the manual without any slot: values go to devices and come from them as they are.",
    "external": (
        "Named by the manual: what declares devices of other processes.  The statement external is what speaks to "
        "it."
    ),
    "UObject": "A device: an object whose slots are variables and functions of Python or of another process.",
    "UVar": "A variable of a device; a slot that holds one reads and writes its value.",
    "UObject.__uobjectName": "The name under which the device is a slot of uobjects.",
    "Localization": "Where a part of a robot is, told apart from its like: front, left, x.",
    "Global.uobjects": "All devices, as slots by their unique names.",
    "Global.uobjects_handle": "What callbacks of UVars may be bound to, as long as the server runs.",
}
"""What no docstring can say: of classes, and of slots that are values or fields."""


@TABLE.primitive("methodToFunction")
def method_to_function(world: World, this: Any, name: str) -> Any:
    """A function that calls the method ``name`` of its first argument with the others."""
    return native(world, name, lambda _, target, *args: world.send(target, name, *args), 1, -1)


@TABLE.lazy("isdef", least=1, most=1)
def isdef(world: World, message: CallMessage) -> bool:
    """Whether a name, or a path of names with dots, means something; nothing is called on the way."""
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
    """``evaluate``: assign a program text, read the value of its last statement."""
    last = [world.void]

    def write(this: Any, source: Any) -> None:
        if not isinstance(source, String):
            raise world.type_error(1, source, "String", "evaluate")
        lobby = world.scheduler.running().context
        try:
            last[0] = programs.evaluate(source.s, lobby or world.global_)
        except Exception as error:  # as with any variable that tells others of its changes, the writer goes on
            if lobby is None:
                raise
            lobby.output.line("!!! Exception caught while processing notify on Global.evaluate:", "error")
            lobby.report(error)

    field(world, world.global_, "evaluate", lambda this: last[0], write)
