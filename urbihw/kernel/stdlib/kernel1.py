"""Kernel1: functions of urbiscript 1, kept for compatibility."""

from __future__ import annotations

from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import CallMessage
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.channel import deprecated
from urbihw.kernel.stdlib.support import send_line
from urbihw.kernel.value import Value

TABLE = Table("Kernel1")
PROTOS = {"Kernel1": ("Singleton",)}

_IGNORED = (
    "commands", "connections", "devices", "events", "functions", "noop", "reset", "runningcommands", "strict",
    "taglist", "undefall", "unstrict", "uservars", "vars",
)  # fmt: skip


@TABLE.primitive(*_IGNORED)
def ignored(world: World, this: Value, *args: Value) -> None:
    """No operation, accepted for compatibility."""


def _method(name: str, argument: str, method: str) -> None:
    def run(world: World, this: Value, value: Value) -> Value:
        deprecated(world, f"{name}({argument})", f"{argument}.{method}")
        return world.send(value, method)

    run.__doc__ = f"Deprecated: use ``{argument}.{method}``."
    TABLE.primitive(name)(run)


_method("copy", "binary", "copy")
_method("seq", "number", "seq")
_method("size", "list", "size")
_method("strlen", "string", "length")


@TABLE.lazy("isvoid", least=1, most=1)
def isvoid(world: World, message: CallMessage) -> Value:
    """Deprecated: use ``obj.isVoid``."""
    deprecated(world, "isvoid(obj)", "obj.isVoid")
    return message.eval_at(0) is world.void


@TABLE.primitive("ping")
def ping(world: World, this: Value) -> None:
    """Print the time in seconds since the start of the server."""
    send_line(world, f"*** pong time={world.scheduler.clock.now():.2f}s")
