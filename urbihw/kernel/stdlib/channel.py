"""Channel: labelled output to the connection that the running job speaks to.

Source: manual, specs/channel and specs/global (cout, cerr, clog, warn); server protocol, section 1.
"""

from __future__ import annotations

from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.object import Obj, Plain
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import Dictionary, List, String
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.support import say

CHANNEL = Table("Channel")
FILTER = Table("Channel.Filter")
GLOBAL = Table("Global")
TABLES = [CHANNEL, FILTER, GLOBAL]
PROTOS = {"Channel.Filter": ("Channel",)}

NOTES = {
    "Channel": "Labelled output to the connection that the running job speaks to.",
    "Channel.enabled": "Whether the channel says anything.",
    "Channel.quote": "Whether strings are shown as literals, in quotes.",
}
"""What no docstring can say: of classes, and of slots that are values or fields."""


def starred(text: str) -> str:
    """A text as ``echo`` shows it: behind three stars."""
    return f"*** {text}" if text else "***"


def deprecated(world: World, old: str, new: str) -> None:
    """Warn of a use of an old name."""
    say(world, starred(f"`{old}' is deprecated, use `{new}'"), "warning")


# ---------------------------------------------------------------- Channel


@CHANNEL.primitive("init")
def init(world: World, this: Any, name: String) -> None:
    """A channel of this label; output of the channel "" has no label."""
    world.ops.put(world.as_obj(this), "name", name)


@CHANNEL.primitive("<<")
def put(world: World, this: Any, value: Any) -> None:
    """Send a value under the label of this channel, strings as literals unless ``quote`` is false."""
    if value is world.void:
        raise errors.unexpected_void()
    if value is world.nil or not world.send(this, "enabled"):
        return
    if isinstance(value, String) and not world.send(this, "quote"):
        text = value.s
    else:
        text = world.text(world.send(value, "asToplevelPrintable"))
    say(world, text, world.text(world.send(this, "name")))


@CHANNEL.primitive("echo")
def echo(world: World, this: Any, value: Any) -> None:
    """Send the text of a value behind three stars, under the label of this channel."""
    if world.send(this, "enabled"):
        say(world, starred(world.text(value)), world.text(world.send(this, "name")))


# ---------------------------------------------------------------- Channel.Filter


@FILTER.primitive("<<")
def put_filtered(world: World, this: Any, value: Any) -> None:
    """Send a value that clients can parse (Float, String, List, Dictionary); any other is shown as by ``echo``."""
    if _parsable(value):
        put(world, this, value)
    elif value is not world.nil:
        echo(world, this, value)


def _parsable(value: Any) -> bool:
    if isinstance(value, List):
        return all(_parsable(member) for member in value.l)
    if isinstance(value, Dictionary):
        return all(_parsable(member) for member in value.d.values())
    return value.__class__ is float or isinstance(value, String)


# ---------------------------------------------------------------- Global


@GLOBAL.primitive("warn")
def warn(world: World, this: Any, message: Any) -> None:
    """Send a message on the channel ``warning``, behind three stars."""
    say(world, starred(world.text(message)), "warning")


def install(world: World, programs: Any) -> None:
    """The predefined channels."""
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
