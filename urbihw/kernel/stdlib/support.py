"""What several modules of the library need: speaking to a job's lobby, slots that are fields, slow work in threads."""

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

Getter = Callable[[Any], Any]
Setter = Callable[[Any, Any], Any]


def say(world: World, text: str, channel: str = "") -> None:
    """Send one line to the lobby the running job speaks to; nothing if it speaks to none."""
    context = world.scheduler.running().context
    if context is not None:
        context.output.line(text, channel)


class Field:
    """An accessor that writes to a Python attribute behind a slot."""

    __slots__ = ("_read", "_write")

    def __init__(self, read: Getter, write: Setter) -> None:
        self._read = read
        self._write = write

    def read(self, target: Any) -> Any:
        """The value of the field of ``target``."""
        return self._read(target)

    def write(self, target: Any, value: Any) -> Any:
        """Somebody assigned the slot of ``target``."""
        self._write(target, value)
        return value


def field(world: World, proto: Obj, name: str, read: Getter, write: Setter, kind: type[Obj] | None = None) -> None:
    """Make a slot of ``proto`` that reads and writes a native field of whatever derives from it.

    ``read(target)`` and ``write(target, value)`` handle urbiscript values; if the field belongs to a ``kind`` of
    objects, nothing else is handed to them.
    """
    if kind is None:
        reader, writer = read, write
    else:
        wanted = kind

        def check(target: Any) -> Any:
            if not isinstance(target, wanted):
                raise world.type_error(None, target, world.type_name(proto), name)
            return target

        def reader(target: Any) -> Any:
            return read(check(target))

        def writer(target: Any, value: Any) -> Any:
            return write(check(target), value)

    proto.slots[name] = make_primitive(world, name, reader, 0, 0)
    meta_of(proto, name).accessor = Field(reader, writer)


def constant(proto: Obj, name: str, value: Any) -> None:
    """Make a constant slot."""
    proto.slots[name] = value
    meta_of(proto, name).constant = True


def native(world: World, name: str, function: Callable[..., Any], least: int, most: int | None = None) -> Primitive:
    """A Primitive made on the spot; ``function(this, *args)`` takes and gives urbiscript values."""
    return make_primitive(world, name, function, least, least if most is None else most)


def slot_holder(world: World, target: Any, name: str) -> Obj:
    """The object that holds the slot ``name`` of ``target``; raises ``lookup failed``."""
    holder = world.peek_obj(target).find(name)
    if holder is None:
        raise errors.lookup_failed(name)
    return holder


def in_thread(world: World, work: Callable[[], Any]) -> Any:
    """Run slow native work in a thread while the running job waits; its value, or the exception it raised."""
    scheduler = world.scheduler
    job = scheduler.running()
    answers: list[tuple[Any, Exception | None]] = []
    waiting = [True]

    def arrived() -> None:
        if waiting:
            scheduler.wake(job)

    def run() -> None:
        try:
            answers.append((work(), None))
        except Exception as error:
            answers.append((None, error))
        scheduler.post(arrived)

    threading.Thread(target=run, daemon=True).start()
    try:
        while not answers:
            scheduler.suspend(None)
    finally:
        waiting.clear()
    value, error = answers[0]
    if error is not None:
        raise error
    return value


def check_descriptors() -> None:
    """Programs may have half of the descriptors of the process: the rest is for clients and for the robot's worker."""
    most = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    if most != resource.RLIM_INFINITY and len(os.listdir("/proc/self/fd")) > most // 2:
        raise errors.primitive("too many files and connections are open")
