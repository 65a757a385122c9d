"""The standard library: one module per urbiscript class, native half and urbiscript half side by side.

``MODULES`` is the boot order.  A module may have

- ``CLASSES``, name of a prototype -> Python class, for prototypes with a native value: ``cls(world, protos)``;
- ``PROTOS``, name of a prototype -> names of its own prototypes, where these are not just Object;
- ``TABLE``, a table of primitives (or ``TABLES``, several): each becomes slots of the prototype of its name;
- ``install(world, programs)`` for slots that a table cannot express (it runs after the tables);
- an urbiscript half, ``<module>.u`` beside it, run with Global as ``this`` after all natives are in place.

``prototype`` finds or makes the object a table belongs to.  May import ``compiler``, ``runtime`` and ``sched``.
"""

from __future__ import annotations

from importlib import import_module
from importlib.resources import files
from typing import Any

from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.world import World

MODULES = (
    "object",
    "properties",
    "describe",
    "comparable",
    "orderable",
    "container",
    "range_iterable",
    "enumeration",
    "singleton",
    "boolean",
    "nil",
    "void",
    "float",
    "float_limits",
    "float_loops",
    "math",
    "executable",
    "call_message",
    "lazy",
    "position",
    "location",
    "exception",
    "job",
    "system",
    "environment",
    "global_slots",
    "duration",
    "date",
    "loadable",
    "pattern",
    "profiling",
    "string",
    "list",
    "channel",
    "lobby",
    "about",
    "tuple",
    "dictionary",
    "finalizable",
    "tag",
    "event",
    "mutex",
    "semaphore",
    "format_info",
    "regexp",
    "group",
    "timeout",
    "trajectory_generator",
    "binary",
    "path",
    "file",
    "stream",
    "process",
    "io_service",
    "network",
    "server",
    "kernel1",
    "documentation",
    "subscription",
    "robot_tree",
    "answers",
    "job_list",
    "server_log",
    "interface",
    "localizer",
    "component",
    "mobile",
)


def prototype(world: World, name: str) -> Obj:
    """The object in Global called ``name`` (``A.B`` for a slot of another object); if it is missing, it is made as a
    child of Object.
    """
    found = world.classes.get(name)
    if found is None:
        path, _, last = name.rpartition(".")
        holder = prototype(world, path) if path else world.global_
        found = holder.slots.get(last)
        if found is None:
            found = world.proto()
            put_prototype(world, name, found)
    assert isinstance(found, Obj)
    return found


def put_prototype(world: World, name: str, made: Obj) -> None:
    """Store ``made`` as the prototype called ``name`` (``A.B`` for a slot of another object)."""
    path, _, last = name.rpartition(".")
    made.slots["type"] = world.string(last)
    holder = prototype(world, path) if path else world.global_
    holder.slots[last] = world.classes[name] = made


def _roots(world: World) -> None:
    known = {
        "Object": world.object,
        "Global": world.global_,
        "Float": world.float_proto,
        "String": world.string_proto,
        "List": world.list_proto,
        "Tuple": world.tuple_proto,
        "Dictionary": world.dictionary_proto,
        "Boolean": world.boolean_proto,
        "Executable": world.executable_proto,
        "Code": world.code_proto,
        "Primitive": world.primitive_proto,
        "Lazy": world.lazy_proto,
        "CallMessage": world.call_message_proto,
        "Exception": world.exception_proto,
        "Lobby": world.lobby_proto,
        "Event": world.event_proto,
        "Tag": world.tag_proto,
    }
    for name, proto in known.items():
        world.global_.slots[name] = world.classes[name] = proto
        proto.slots["type"] = world.string(name)
    values = {"nil": world.nil, "void": world.void, "true": world.true, "false": world.false}
    world.global_.slots.update(values)
    world.classes.update(values)


def install(world: World, programs: Any) -> None:
    """Install the whole library in a world: first the natives, then the urbiscript halves in a job that is run here."""
    _roots(world)
    modules = [import_module(f"urbihw.kernel.stdlib.{name}") for name in MODULES]
    for module in modules:
        for name, native in getattr(module, "CLASSES", {}).items():
            put_prototype(world, name, native(world, [world.object]))
    for module in modules:
        for name, parents in getattr(module, "PROTOS", {}).items():
            prototype(world, name).protos = [prototype(world, parent) for parent in parents]
    for module in modules:
        tables = getattr(module, "TABLES", None) or ([module.TABLE] if hasattr(module, "TABLE") else [])
        for table in tables:
            table.install(world, prototype(world, table.proto))
        if hasattr(module, "install"):
            module.install(world, programs)
    world.flush()
    _run_urbiscript(world, programs)


def _run_urbiscript(world: World, programs: Any) -> None:
    def run() -> None:
        for name in MODULES:
            source = files("urbihw.kernel.stdlib").joinpath(name + ".u")
            if source.is_file():
                programs.load_library(source.read_text("latin-1"), f"{name}.u")

    job = world.scheduler.spawn(run, "boot")
    while not job.done:  # ``run`` may return early on a slow machine
        world.scheduler.run()
    if job.error is not None:
        raise job.error
