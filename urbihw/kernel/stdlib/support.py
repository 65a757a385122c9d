"""Helpers of several library modules: output to a job's lobby, fields as slots, slow work in threads."""

from __future__ import annotations

import os
import resource
import threading
from collections.abc import Callable
from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.code import Primitive, make_primitive
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.slot import meta_of
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.waiting import Completion
from urbihw.kernel.value import Value

Getter = Callable[[Any], Any]
Setter = Callable[[Any, Any], Any]


def send_line(world: World, text: str, channel: str = "") -> None:
    """Send one line to the lobby of the running job; without a lobby it goes to ``World.unheard``."""
    context = world.scheduler.running().context
    if context is not None:
        context.output.line(text, channel)
    else:
        world.unheard(text)


class Field:
    """An accessor of a Python attribute as a slot."""

    __slots__ = ("_read", "_write")

    def __init__(self, read: Getter, write: Setter) -> None:
        self._read = read
        self._write = write

    def read(self, target: Value) -> Value:
        """The value of the attribute of ``target``."""
        return self._read(target)

    def write(self, target: Value, value: Value) -> Value:
        """Called when the slot of ``target`` is assigned."""
        self._write(target, value)
        return value


def field(world: World, proto: Obj, name: str, read: Getter, write: Setter, kind: type[Obj] | None = None) -> None:
    """Make a slot of ``proto`` that reads and writes a native field of the objects derived from it.

    ``read(target)`` and ``write(target, value)`` handle urbiscript values; with a ``kind``, they are called only for
    objects of that kind.
    """
    if kind is None:
        reader, writer = read, write
    else:
        wanted = kind

        def check(target: Value) -> Value:
            if not isinstance(target, wanted):
                raise world.type_error(None, target, world.type_name(proto), name)
            return target

        def reader(target: Value) -> Value:
            return read(check(target))

        def writer(target: Value, value: Value) -> Value:
            return write(check(target), value)

    proto.slots[name] = make_primitive(world, name, reader, 0, 0)
    meta_of(proto, name).accessor = Field(reader, writer)


def constant(proto: Obj, name: str, value: Value) -> None:
    """Make a constant slot."""
    proto.slots[name] = value
    meta_of(proto, name).constant = True


def native(world: World, name: str, function: Callable[..., Any], least: int, most: int | None = None) -> Primitive:
    """Make a Primitive of a Python function; ``function(this, *args)`` gets and returns urbiscript values."""
    return make_primitive(world, name, function, least, least if most is None else most)


def slot_holder(world: World, target: Value, name: str) -> Obj:
    """The object that has the slot ``name`` of ``target``.  Raises ``lookup failed``."""
    holder = world.peek_obj(target).find(name)
    if holder is None:
        raise errors.lookup_failed(name)
    return holder


def in_thread(world: World, work: Callable[[], Any]) -> Any:
    """Run slow native work in a thread while the running job waits; returns its value or raises its exception."""
    scheduler = world.scheduler
    answer: Completion[Any] = Completion(scheduler)
    threading.Thread(target=lambda: scheduler.post(answer.outcome_of(work)), daemon=True).start()
    return answer.wait()


def check_descriptors() -> None:
    """Raise an error if programs use more than half of the process's descriptors: the rest is for clients and for the
    robot's worker.
    """
    most = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    if most != resource.RLIM_INFINITY and len(os.listdir("/proc/self/fd")) > most // 2:
        raise errors.primitive("too many files and connections are open")
