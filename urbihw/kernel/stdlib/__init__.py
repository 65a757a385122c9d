"""The standard library: one module per urbiscript class, native half and urbiscript half side by side.

``MODULES`` is the boot order; the modules of other libraries (``Library``) come after them.  A module may have

- ``CLASSES``, name of a prototype -> Python class, for prototypes with a native value: ``cls(world, protos)``;
- ``PROTOS``, name of a prototype -> names of its own prototypes, where these are not just Object;
- ``TABLE``, a table of primitives (or ``TABLES``, several): each becomes slots of the prototype of its name;
- ``install(world, programs)`` for slots that a table cannot express (it runs after the tables);
- an urbiscript half, ``<module>.u`` beside it, run with Global as ``this`` after all natives are in place.

``prototype`` finds or makes the object a table belongs to.  May import ``compiler``, ``runtime`` and ``sched``; a
library outside of the kernel imports ``urbihw.kernel.library``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

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
    "signatures",
    "completions",
    "job_list",
    "server_log",
)


class Library(NamedTuple):
    """A package with classes for urbiscript.

    Attributes:
        package: its full name.
        modules: the names of its modules, in the order of loading.
    """

    package: str
    modules: tuple[str, ...]

    def imported(self) -> list[ModuleType]:
        """Its modules, imported in the order of loading."""
        return [import_module(f"{self.package}.{name}") for name in self.modules]

    def texts(self) -> Iterator[tuple[str, str]]:
        """Its urbiscript halves: file name and text of each."""
        folder = Path(import_module(self.package).__file__ or "").parent
        for name in self.modules:
            source = folder / f"{name}.u"
            if source.is_file():
                yield source.name, source.read_text("latin-1")


class Libraries(list[Library]):
    """The libraries of a world, in the order of loading; a part of the world."""


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


def install(world: World, programs: Any, others: Sequence[Library]) -> None:
    """Install the standard library and others in a world: first the natives of all, then their urbiscript halves, in a
    job that is run here.
    """
    _roots(world)
    libraries = Libraries([Library(__name__, MODULES), *others])
    world.install_part(libraries)
    modules = [module for library in libraries for module in library.imported()]
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
    _run_urbiscript(world, programs, libraries)


def _run_urbiscript(world: World, programs: Any, libraries: Libraries) -> None:
    def run() -> None:
        for library in libraries:
            for file, text in library.texts():
                programs.load_library(text, file)

    job = world.scheduler.spawn(run, "boot")
    while not job.done:  # ``run`` may return early on a slow machine
        world.scheduler.run()
    if job.error is not None:
        raise job.error
