"""Channel: labelled output to the connection of the running job.

Source: manual, specs/channel and specs/global (cout, cerr, clog, warn); server protocol, section 1.
"""

from __future__ import annotations

from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.object import Obj, Plain
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import Dictionary, List, String
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.support import send_line
from urbihw.kernel.value import Value

CHANNEL = Table("Channel")
FILTER = Table("Channel.Filter")
GLOBAL = Table("Global")
TABLES = [CHANNEL, FILTER, GLOBAL]
PROTOS = {"Channel.Filter": ("Channel",)}

NOTES = {
    "Channel": "Labelled output to the connection of the running job.",
    "Channel.enabled": "Whether the channel sends its output.",
    "Channel.quote": "Whether strings are sent as literals, in quotes.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


def starred(text: str, prefix: str = "***") -> str:
    """A text as ``echo`` prints it: after three stars, or another prefix."""
    return f"{prefix} {text}" if text else prefix


def deprecated(world: World, old: str, new: str) -> None:
    """Warn that a program uses a deprecated name."""
    send_line(world, starred(f"`{old}' is deprecated, use `{new}'"), "warning")


# ---------------------------------------------------------------- Channel


@CHANNEL.primitive("init")
def init(world: World, this: Value, name: String) -> None:
    """Make a channel with this label; output of the channel "" has no label."""
    world.ops.put_slot(world.as_obj(this), "name", name)


@CHANNEL.primitive("<<")
def put(world: World, this: Value, value: Value) -> None:
    """Send a value with the label of this channel; strings are sent as literals unless ``quote`` is false."""
    if value is world.void:
        raise errors.unexpected_void()
    if value is world.nil or not world.send(this, "enabled"):
        return
    if isinstance(value, String) and not world.send(this, "quote"):
        text = value.s
    else:
        text = world.text(world.send(value, "asToplevelPrintable"))
    send_line(world, text, world.text(world.send(this, "name")))


@CHANNEL.primitive("echo")
def echo(world: World, this: Value, value: Value) -> None:
    """Send the text of a value after three stars, with the label of this channel."""
    if world.send(this, "enabled"):
        send_line(world, starred(world.text(value)), world.text(world.send(this, "name")))


# ---------------------------------------------------------------- Channel.Filter


@FILTER.primitive("<<")
def put_filtered(world: World, this: Value, value: Value) -> None:
    """Send a value of a type that clients can parse (Float, String, List, Dictionary); any other value is sent as by
    ``echo``.
    """
    if _parsable(value):
        put(world, this, value)
    elif value is not world.nil:
        echo(world, this, value)


def _parsable(value: Value) -> bool:
    if isinstance(value, List):
        return all(_parsable(member) for member in value.l)
    if isinstance(value, Dictionary):
        return all(_parsable(member) for member in value.d.values())
    return value.__class__ is float or isinstance(value, String)


# ---------------------------------------------------------------- Global


@GLOBAL.primitive("warn")
def warn(world: World, this: Value, message: Value) -> None:
    """Send a message on the channel ``warning``, after three stars."""
    send_line(world, starred(world.text(message)), "warning")


def install(world: World, programs: Any) -> None:
    """Make the predefined channels."""
    proto = world.global_.slots["Channel"]
    proto.slots.update({"name": world.string(""), "quote": world.true, "enabled": world.true})

    def made(name: str, **slots: Any) -> Obj:
        channel = Plain(world, [proto])
        channel.slots.update({"name": world.string(name), **slots})
        return channel

    proto.slots["topLevel"] = made("")
    proto.slots["null"] = made("", enabled=world.false)
    proto.slots["warning"] = made("warning", quote=world.false)
    world.global_.slots["cout"] = made("output")
    world.global_.slots["clog"] = made("clog")
    world.global_.slots["cerr"] = made("error", quote=world.false)
    world.lobby_proto.protos = [proto.slots["topLevel"]]
