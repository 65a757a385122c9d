"""System: time, evaluation, source files, assertions, and information about the process.  ``environment`` has the
rest.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.compiler import print_node
from urbihw.kernel.runtime.backtrace import current_stack
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import CallMessage, String
from urbihw.kernel.runtime.world import KERNEL_JOB, World
from urbihw.kernel.sched.waiting import wait_for_ever
from urbihw.kernel.stdlib import prototype
from urbihw.kernel.stdlib.file import read
from urbihw.kernel.stdlib.job import job_value
from urbihw.kernel.stdlib.path import from_system
from urbihw.kernel.stdlib.slices import in_slices
from urbihw.kernel.stdlib.support import field, native, send_line
from urbihw.kernel.value import Value

TABLE = Table("System")
PROTOS = {"System": ("Object",)}
VERSION = "2.3.0"
"""The implemented version of the language."""

NOTES = {
    "System": "The server: time, evaluation of programs, files, the environment, the process.",
    "System.arguments": "The command line arguments for the program, as a List of Strings.",
    "System.eval": (
        "Run a program text in this object; returns the value of its last statement.  Raises Syntax for an invalid "
        "text, of which nothing is run."
    ),
    "System.load": (
        "Run a file of urbiscript from the search path; returns the value of its last statement.  Raises "
        "FileNotFound."
    ),
    "System.loadFile": "Run a file of urbiscript; returns the value of its last statement.  Raises FileNotFound.",
    "System.maybeLoad": "Load the file if it exists, and report it on the channel; void if it does not exist.",
    "System.lobbies": "The same as Lobby.instances.",
    "System.lobby": "The lobby of the connection whose code is running.",
    "System.ndebug": "Whether assertions are skipped; initially false, can be assigned.",
    "System.period": (
        "The interval in seconds between two steps of a trajectory; initially 20ms, can be assigned.  Raises "
        "NonPositiveNumber."
    ),
    "System.programName": "The path of the server's program, as it was started.",
    "System.shutdown": "End the server: close all connections, stop all devices.",
    "System.timeReference": "Midnight of the day on which the server started: time stamps of remotes count from there.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


# ---------------------------------------------------------------- time


@TABLE.primitive("time")
def time(world: World, this: Value) -> float:
    """Seconds since the start of the server."""
    return world.scheduler.clock.now()


@TABLE.primitive("shiftedTime")
def shifted_time(world: World, this: Value) -> float:
    """Seconds since the start of the server, minus the time during which the running job was frozen."""
    return world.scheduler.running().local_time(world.scheduler.clock.now())


@TABLE.primitive("sleep")
def sleep(world: World, this: Value, duration: float = float("inf")) -> None:
    """Sleep for a duration in seconds; without an argument, for ever."""
    if duration == float("inf"):
        wait_for_ever(world.scheduler)
    else:
        world.scheduler.sleep(duration)


@TABLE.primitive("redefinitionMode")
def redefinition_mode(world: World, this: Value) -> None:
    """Let ``var`` redefine existing slots until the end of the running function or top-level statement."""
    world.redefinition.begin()


@TABLE.primitive("cycle")
def cycle(world: World, this: Value) -> int:
    """The number of rounds of the scheduler since the start."""
    # `;` starts a new round only if another job is ready; a program that reads the cycle expects one at every `;`
    world.spawn_own(lambda: world.void, "cycle")
    return world.scheduler.cycle


@TABLE.primitive("jobs")
def jobs(world: World, this: Value) -> Value:
    """The running jobs of programs; internal jobs of the server are not included."""
    running = in_slices(world, [job for job in world.scheduler.jobs if job.face is not KERNEL_JOB])
    return world.new_list([job_value(world, job) for job in running if not job.done])


@TABLE.primitive("aliveJobs")
def alive_jobs(world: World, this: Value) -> int:
    """The number of running jobs of programs."""
    return sum(job.face is not KERNEL_JOB for job in world.scheduler.jobs)


# ---------------------------------------------------------------- assertions


def _failed(text: str) -> errors.Raised:
    return errors.Raised("Exception", f"failed assertion: {text}", None)


@TABLE.lazy("assert", least=1, most=1)
def assert_lazy(world: World, message: CallMessage) -> None:
    """Raise ``failed assertion`` if the argument is false, unless ``ndebug`` is set."""
    if not world.ndebug and not message.eval_at(0):
        node = message.args[0].node
        raise _failed("" if node is None else print_node(node))


@TABLE.primitive("assert_")
def assert_message(world: World, this: Value, claim: Value, message: str) -> None:
    """Raise ``failed assertion: message`` if the condition is false."""
    if not claim:
        raise _failed(message)


@TABLE.primitive("assert_op")
def assert_operator(world: World, this: Value, operator: str, left: Value, right: Value) -> None:
    """Deprecated, use ``assert``: raise ``failed assertion`` if ``left operator right`` is false."""
    if not world.send(left, operator, right):
        raise _failed(f"{world.printable(left)} {operator} {world.printable(right)}")


@TABLE.primitive("backtrace")
def backtrace(world: World, this: Value) -> None:
    """Print the call stack on the channel ``backtrace``, innermost call first."""
    for step in current_stack().calls:
        send_line(world, f"{step.name} ({step.location})", "backtrace")


# ---------------------------------------------------------------- the process


@TABLE.primitive("resetLibrary")
def reset_library(world: World, this: Value, what: Value = None) -> Value:
    """Restore the slots of the library that programs have removed or redefined: all slots, those of one object, or
    those with a name such as "String.size" or "Object.protos".  Returns the names of the restored slots.

    Variables keep their values unless they are named.  Raises Primitive for a name that is not in the library.  The
    function has a long name because all objects inherit the slots of System, and programs often use the name ``reset``.
    """
    names = world.record.reset(what.s if isinstance(what, String) else what)
    return world.new_list([world.string(name) for name in names])


@TABLE.primitive("version")
def version(world: World, this: Value) -> str:
    """The version of the language."""
    return VERSION


# ---------------------------------------------------------------- files of source


def search_path() -> list[str]:
    """The folders of urbiscript files: ``URBI_PATH``, where an empty entry stands for the current folder."""
    return [part or "." for part in os.environ.get("URBI_PATH", "").split(os.pathsep)]


def find_source(name: str) -> Path | None:
    """The absolute path of the file with this name on the search path, or None."""
    for folder in search_path():
        found = Path(folder, name)
        if found.is_file():
            return found.absolute()
    return None


def file_not_found(name: str) -> errors.Raised:
    """The error ``file not found: name``."""
    return errors.Raised("FileNotFound", f"file not found: {name}", None, name=name)


def _file_name(world: World, value: Value) -> str:
    if world.is_a(value, world.classes["Path"]):
        return world.text(value)
    if not isinstance(value, String):
        raise world.type_error(1, value, "String")
    return value.s


@TABLE.primitive("searchPath")
def search_path_value(world: World, this: Value) -> Value:
    """The folders in which ``load`` searches for files, as a List of Paths."""
    return world.new_list([_path(world, folder) for folder in search_path()])


@TABLE.primitive("searchFile")
def search_file(world: World, this: Value, file: Value) -> Value:
    """The Path of a file on the search path.  Raises FileNotFound."""
    name = _file_name(world, file)
    found = find_source(name)
    if found is None:
        raise file_not_found(name)
    return _path(world, str(found))


def _path(world: World, name: str) -> Any:
    return world.send(world.classes["Path"], "new", world.string(name))


def install(world: World, programs: Any) -> None:
    """Install the functions that use the programs of this kernel: evaluation, arguments, exit; and the assignable
    fields.
    """
    system = prototype(world, "System")

    def put(name: str, function: Value, least: int, most: int | None = None) -> None:
        system.slots[name] = native(world, name, function, least, most)

    def shutdown(this: Value) -> Value:
        programs.process.shutdown()
        return world.void

    put("lobby", lambda this: world.ops.send0(world.lobby_proto, "lobby"), 0)
    put("lobbies", lambda this: world.ops.send0(world.lobby_proto, "instances"), 0)
    put("shutdown", shutdown, 0)
    put("arguments", lambda this: world.from_python(list(programs.process.arguments)), 0)
    put("programName", lambda this: world.string(programs.process.name), 0)
    _install_evaluation(world, system, programs)
    _fields(world, system)


def _install_evaluation(world: World, system: Value, programs: Any) -> None:
    """Install the functions that evaluate programs: ``eval`` and the loading of files."""

    def context(this: Value) -> Value:
        """System.eval evaluates in the lobby."""
        return world.scheduler.running().context or this if this is system else this

    def evaluate(this: Value, source: Value) -> Value:
        if not isinstance(source, String):
            raise world.type_error(1, source, "String")
        return programs.evaluate(source.s, context(this))

    def run_file(this: Value, path: Path | None, name: str) -> Value:
        if path is None or not path.is_file():
            raise file_not_found(name)
        return programs.evaluate(read(world, from_system(os.fsencode(path))), context(this), name)

    def load(this: Value, file: Value) -> Value:
        name = _file_name(world, file)
        return run_file(this, find_source(name), name)

    def load_file(this: Value, file: Value) -> Value:
        name = _file_name(world, file)
        return run_file(this, Path(name), name)

    def maybe_load(this: Value, file: Value, channel: Value = None) -> Value:
        name = _file_name(world, file)
        path = find_source(name)
        if path is None:
            return world.void
        if channel is not None:
            world.send(channel, "echo", world.string(f"loading {path}."))
        return run_file(this, path, name)

    for name, function in (("eval", evaluate), ("load", load), ("loadFile", load_file)):
        system.slots[name] = native(world, name, function, 1, 1)
    system.slots["maybeLoad"] = native(world, "maybeLoad", maybe_load, 1, 2)


def _fields(world: World, system: Value) -> None:
    def write_period(this: Value, value: Value) -> None:
        period = world.as_float(value, 1, "period")
        if not 0 < period < float("inf"):
            raise errors.bad_number("NonPositiveNumber", f"expected positive number, got {world.text(value)}", value)
        world.period = period

    def write_ndebug(this: Value, value: Value) -> None:
        world.ndebug = bool(value)

    field(world, system, "period", lambda this: world.period + 0.0, write_period)
    field(world, system, "ndebug", lambda this: world.boolean(world.ndebug), write_ndebug)


