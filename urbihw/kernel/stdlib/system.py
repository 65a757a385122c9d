"""System: time, evaluation, files of source, assertions, and what the process is.  ``environment`` has the rest."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from types import FrameType
from typing import Any
from weakref import WeakKeyDictionary

from urbihw.kernel import errors
from urbihw.kernel.compiler import print_node
from urbihw.kernel.runtime.backtrace import calling_frame, current_stack
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import CallMessage, String
from urbihw.kernel.runtime.world import OWN, World
from urbihw.kernel.sched.job import Job
from urbihw.kernel.stdlib import prototype
from urbihw.kernel.stdlib.file import read
from urbihw.kernel.stdlib.job import job_value
from urbihw.kernel.stdlib.path import from_system
from urbihw.kernel.stdlib.support import field, native, say

TABLE = Table("System")
PROTOS = {"System": ("Object",)}
VERSION = "2.3"
"""The version of the language served."""

NOTES = {
    "System": "The server: time, evaluation of programs, files, the environment, the process.",
    "System.arguments": "The arguments of the command line that are meant for the program, as a List of Strings.",
    "System.eval": (
        "Run a program text in this object and give the value of its last statement; raises Syntax if it is none, "
        "and then nothing runs."
    ),
    "System.load": (
        "Find a file of urbiscript on the search path, run it, and give the value of its last statement; raises "
        "FileNotFound."
    ),
    "System.loadFile": "Run a file of urbiscript and give the value of its last statement; raises FileNotFound.",
    "System.maybeLoad": "load if there is such a file, and tell the channel of it; void if there is none.",
    "System.lobbies": "Lobby.instances.",
    "System.lobby": "The lobby of the connection whose code is running.",
    "System.ndebug": "Whether assertions are left out; false at first, can be assigned.",
    "System.period": (
        "The time in seconds between two steps of a trajectory, and between two looks at what cannot say that it "
        "changed; 20ms at first, can be assigned, raises NonPositiveNumber."
    ),
    "System.programName": "The path under which the server was called.",
    "System.redefinitionMode": (
        "Let var overwrite slots that exist until the running function, or the statement at top level, is over."
    ),
    "System.shutdown": "End the server: close all connections, stop all devices.",
    "System.timeReference": "Midnight of the day on which the server began: remotes count their stamps from there.",
}
"""What no docstring can say: of classes, and of slots that are values or fields."""


# ---------------------------------------------------------------- time


@TABLE.primitive("time")
def time(world: World, this: Any) -> float:
    """Seconds since the server was started."""
    return world.scheduler.clock.now()


@TABLE.primitive("shiftedTime")
def shifted_time(world: World, this: Any) -> float:
    """Seconds since the server was started, less what the running job spent frozen."""
    return world.scheduler.running().local_time(world.scheduler.clock.now())


@TABLE.primitive("sleep")
def sleep(world: World, this: Any, duration: float = float("inf")) -> None:
    """Do nothing for a duration in seconds; for ever without one."""
    if duration == float("inf"):
        world.scheduler.suspend(None)
    else:
        world.scheduler.sleep(duration)


@TABLE.primitive("cycle")
def cycle(world: World, this: Any) -> int:
    """The number of rounds of the scheduler since the beginning."""
    # `;` makes a new round only when somebody else is ready: who reads the cycle wants to see every `;`
    world.spawn_own(lambda: world.void, "cycle")
    return world.scheduler.cycle


@TABLE.primitive("jobs")
def jobs(world: World, this: Any) -> Any:
    """The jobs of programs that are not over; the server's own are nobody's business."""
    return world.new_list([job_value(world, job) for job in world.scheduler.jobs if job.face is not OWN])


@TABLE.primitive("aliveJobs")
def alive_jobs(world: World, this: Any) -> int:
    """How many jobs of programs are not over."""
    return sum(job.face is not OWN for job in world.scheduler.jobs)


# ---------------------------------------------------------------- assertions


def _failed(text: str) -> errors.Raised:
    return errors.Raised("Exception", f"failed assertion: {text}", None)


@TABLE.lazy("assert", least=1, most=1)
def assert_lazy(world: World, message: CallMessage) -> None:
    """Raise ``failed assertion`` if the argument is not true, unless ``ndebug``."""
    if not world.ndebug and not message.eval_at(0):
        node = message.args[0].node
        raise _failed("" if node is None else print_node(node))


@TABLE.primitive("assert_")
def assert_message(world: World, this: Any, claim: Any, message: str) -> None:
    """Raise ``failed assertion: message`` if the claim is not true."""
    if not claim:
        raise _failed(message)


@TABLE.primitive("assert_op")
def assert_operator(world: World, this: Any, operator: str, left: Any, right: Any) -> None:
    """Deprecated, use ``assert``: raise ``failed assertion`` if ``left operator right`` is not true."""
    if not world.send(left, operator, right):
        raise _failed(f"{world.printable(left)} {operator} {world.printable(right)}")


@TABLE.primitive("backtrace")
def backtrace(world: World, this: Any) -> None:
    """Say the calls that led here on the channel ``backtrace``, innermost first."""
    for step in current_stack().calls:
        say(world, f"{step.name} ({step.location})", "backtrace")


# ---------------------------------------------------------------- the process


@TABLE.primitive("resetLibrary")
def reset_library(world: World, this: Any, what: Any = None) -> Any:
    """Bring back what programs removed from the library, or defined anew: all of it, one object, or what a name such as
    "String.size" or "Object.protos" means.  Gives the names of what was put back.

    Variables keep their values, unless named.  Raises Primitive for what the library does not have.  The name is long
    since all objects inherit the slots of System, and ``reset`` is a name for many things.
    """
    names = world.record.reset(what.s if isinstance(what, String) else what)
    return world.new_list([world.string(name) for name in names])


@TABLE.primitive("version")
def version(world: World, this: Any) -> str:
    """The version of the language."""
    return VERSION


# ---------------------------------------------------------------- files of source


def search_path() -> list[str]:
    """The folders of urbiscript files: ``URBI_PATH``, where an empty part stands for the current folder."""
    return [part or "." for part in os.environ.get("URBI_PATH", "").split(os.pathsep)]


def find_source(name: str) -> Path | None:
    """The file of this name on the search path, absolute, or None."""
    for folder in search_path():
        found = Path(folder, name)
        if found.is_file():
            return found.absolute()
    return None


def file_not_found(name: str) -> errors.Raised:
    """``file not found: name``."""
    return errors.Raised("FileNotFound", f"file not found: {name}", None, name=name)


def _file_name(world: World, value: Any) -> str:
    if world.is_a(value, world.classes["Path"]):
        return world.text(value)
    if not isinstance(value, String):
        raise world.type_error(1, value, "String")
    return value.s


@TABLE.primitive("searchPath")
def search_path_value(world: World, this: Any) -> Any:
    """The folders where ``load`` looks for files, as a List of Paths."""
    return world.new_list([_path(world, folder) for folder in search_path()])


@TABLE.primitive("searchFile")
def search_file(world: World, this: Any, file: Any) -> Any:
    """The Path of a file on the search path; raises FileNotFound."""
    name = _file_name(world, file)
    found = find_source(name)
    if found is None:
        raise file_not_found(name)
    return _path(world, str(found))


def _path(world: World, name: str) -> Any:
    return world.send(world.classes["Path"], "new", world.string(name))


def install(world: World, programs: Any) -> None:
    """What needs the programs of this kernel: evaluation, arguments, the end; and the fields that can be assigned."""
    system = prototype(world, "System")

    def put(name: str, function: Any, least: int, most: int | None = None) -> None:
        system.slots[name] = native(world, name, function, least, most)

    def context(this: Any) -> Any:
        """Whoever says System.eval means the lobby."""
        return world.scheduler.running().context or this if this is system else this

    def evaluate(this: Any, source: Any) -> Any:
        if not isinstance(source, String):
            raise world.type_error(1, source, "String")
        return programs.evaluate(source.s, context(this))

    def run_file(this: Any, path: Path | None, name: str) -> Any:
        if path is None or not path.is_file():
            raise file_not_found(name)
        return programs.evaluate(read(world, from_system(os.fsencode(path))), context(this), name)

    def load(this: Any, file: Any) -> Any:
        name = _file_name(world, file)
        return run_file(this, find_source(name), name)

    def load_file(this: Any, file: Any) -> Any:
        name = _file_name(world, file)
        return run_file(this, Path(name), name)

    def maybe_load(this: Any, file: Any, channel: Any = None) -> Any:
        name = _file_name(world, file)
        path = find_source(name)
        if path is None:
            return world.void
        if channel is not None:
            world.send(channel, "echo", world.string(f"loading {path}."))
        return run_file(this, path, name)

    def shutdown(this: Any) -> Any:
        programs.shutdown()
        return world.void

    put("lobby", lambda this: world.ops.send0(world.lobby_proto, "lobby"), 0)
    put("lobbies", lambda this: world.ops.send0(world.lobby_proto, "instances"), 0)
    put("eval", evaluate, 1)
    put("load", load, 1)
    put("loadFile", load_file, 1)
    put("maybeLoad", maybe_load, 1, 2)
    put("shutdown", shutdown, 0)
    put("arguments", lambda this: world.from_python(list(programs.arguments)), 0)
    put("programName", lambda this: world.string(programs.name), 0)
    put("redefinitionMode", redefinition_mode(world), 0)
    _fields(world, system)


def redefinition_mode(world: World) -> Any:
    """``redefinitionMode``: ``var`` may overwrite slots as long as the function that asked for it runs.

    Only the attempt to create a slot that exists looks at the mode, so that it costs nothing otherwise.
    """
    modes: WeakKeyDictionary[Job, FrameType] = WeakKeyDictionary()

    def run(this: Any) -> Any:
        frame = calling_frame()
        if frame is not None:
            modes[world.scheduler.running()] = frame
        return world.void

    def redefining() -> bool:
        job = world.scheduler.current
        if job is None or job not in modes:
            return False
        frame: FrameType | None = sys._getframe(1)
        while frame is not None and frame is not modes[job]:
            frame = frame.f_back
        if frame is None:
            del modes[job]
        return frame is not None

    world.redefining = redefining
    return run


def _fields(world: World, system: Any) -> None:
    def write_period(this: Any, value: Any) -> None:
        period = world.as_float(value, 1, "period")
        if not 0 < period < float("inf"):
            raise errors.bad_number("NonPositiveNumber", f"expected positive number, got {world.text(value)}")
        world.period = period

    def write_ndebug(this: Any, value: Any) -> None:
        world.ndebug = bool(value)

    field(world, system, "period", lambda this: world.period + 0.0, write_period)
    field(world, system, "ndebug", lambda this: world.boolean(world.ndebug), write_ndebug)


