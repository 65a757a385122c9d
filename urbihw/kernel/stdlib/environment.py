"""System: the environment of the process, commands of the operating system, Platform and PackageInfo."""

from __future__ import annotations

import os
import platform
import subprocess
from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.waiting import wait_for_ever
from urbihw.kernel.stdlib import prototype
from urbihw.kernel.stdlib.child import Child
from urbihw.kernel.stdlib.support import constant
from urbihw.kernel.value import Value

TABLE = Table("System")
PROTOS = {"System.Platform": ("Object",), "System.PackageInfo": ("Object",)}

NOTES = {
    "System.PackageInfo": "Information about the Urbi SDK, whose language this is.",
    "System.Platform": "Information about the machine and the operating system.",
    "System.Platform.isWindows": "Whether the operating system is Windows.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


@TABLE.primitive("getenv")
def getenv(world: World, this: Value, name: str) -> Value:
    """The value of an environment variable, nil if it is not set."""
    return _text(world, os.environb.get(name.encode("latin-1", "replace")))


@TABLE.primitive("setenv")
def setenv(world: World, this: Value, name: str, value: Value) -> str:
    """Set an environment variable to the text of a value; returns that text."""
    text = world.text(value)
    if name == "" or "=" in name or "\0" in name + text:
        raise errors.primitive(f"the environment takes no such name or value: {world.printable(world.string(name))}")
    os.environb[name.encode("latin-1", "replace")] = text.encode("latin-1", "replace")
    return text


@TABLE.primitive("unsetenv")
def unsetenv(world: World, this: Value, name: str) -> Value:
    """Remove an environment variable; returns its former value, nil if it was not set."""
    key = name.encode("latin-1", "replace")
    return _text(world, os.environb.pop(key, None))


def _text(world: World, value: bytes | None) -> Value:
    return world.nil if value is None else world.string(value.decode("latin-1"))


@TABLE.primitive("scopeTag")
def scope_tag(world: World, this: Value) -> None:
    """Another name of ``Tag.scope``.  It must be used directly in the scope, like ``Tag.scope``."""
    raise errors.primitive("must be called as `scopeTag' in the scope that it is for")


@TABLE.primitive("system")
def system(world: World, this: Value, command: str) -> int:
    """Run a shell command and wait for its end; other jobs continue.

    Returns the status of the operating system: the exit code times 256, or the number of the signal that ended the
    command.
    """
    if "\0" in command:
        raise errors.primitive("commands cannot have a null character in them")
    code = Child(world, lambda group: subprocess.Popen(command, shell=True, process_group=group)).wait()
    return code << 8 if code >= 0 else -code


def install(world: World, programs: Any) -> None:
    """Make the descriptions of the machine (Platform) and of the Urbi SDK whose language is implemented
    (PackageInfo).
    """
    cpu, name = platform.machine() or "unknown", "linux-gnu"
    vendor = "pc" if cpu in ("i386", "i686", "x86_64") else "unknown"
    machine = {
        "host": f"{cpu}-{vendor}-{name}",
        "hostAlias": "",
        "hostCpu": cpu,
        "hostOs": name,
        "hostVendor": vendor,
        "isWindows": False,
        "kind": "POSIX",
    }
    package = {"copyrightHolder": "Gostai S.A.S.", "copyrightYears": "2005-2010"}
    for path, slots in (("System.Platform", machine), ("System.PackageInfo", package)):
        for slot, value in slots.items():
            constant(prototype(world, path), slot, world.from_python(value))
    table = Table("System")

    @table.primitive("reboot")
    def reboot(world: World, this: Value) -> None:
        """End the server as ``shutdown`` does, and start it again with the same arguments.  Raises an error if the
        process that started the server does not support that."""
        begin_reboot = programs.process.reboot
        if begin_reboot is None:
            raise errors.primitive("this server cannot start itself anew: use shutdown, and start it again")
        begin_reboot()

    @table.primitive("_exit")
    def exit_(world: World, this: Value, status: int) -> None:
        """End the server as ``shutdown`` does, with this exit code; the statements after it are not run."""
        # The manual describes an immediate exit.  This server stops its robot and disconnects its other clients in
        # order.
        programs.exit(status)
        wait_for_ever(world.scheduler)

    table.install(world, prototype(world, "System"))
