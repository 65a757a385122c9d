"""System: the environment of the process, commands of the operating system, Platform and PackageInfo."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib import prototype
from urbihw.kernel.stdlib.child import Child
from urbihw.kernel.stdlib.support import constant

TABLE = Table("System")
PROTOS = {"System.Platform": ("Object",), "System.PackageInfo": ("Object",)}

NOTES = {
    "System.PackageInfo": "Whose language this is.",
    "System.Platform": "The machine and the operating system.",
    "System.Platform.isWindows": "Whether this is Windows.",
}
"""What no docstring can say: of classes, and of slots that are values or fields."""


@TABLE.primitive("getenv")
def getenv(world: World, this: Any, name: str) -> Any:
    """The value of an environment variable, nil if it is not set."""
    return _text(world, os.environb.get(name.encode("latin-1", "replace")))


@TABLE.primitive("setenv")
def setenv(world: World, this: Any, name: str, value: Any) -> str:
    """Set an environment variable to the text of a value; returns that text."""
    text = world.text(value)
    if name == "" or "=" in name or "\0" in name + text:
        raise errors.primitive(f"the environment takes no such name or value: {world.printable(world.string(name))}")
    os.environb[name.encode("latin-1", "replace")] = text.encode("latin-1", "replace")
    return text


@TABLE.primitive("unsetenv")
def unsetenv(world: World, this: Any, name: str) -> Any:
    """Remove an environment variable; returns what it was, nil if it was not set."""
    key = name.encode("latin-1", "replace")
    return _text(world, os.environb.pop(key, None))


def _text(world: World, value: bytes | None) -> Any:
    return world.nil if value is None else world.string(value.decode("latin-1"))


@TABLE.primitive("scopeTag")
def scope_tag(world: World, this: Any) -> None:
    """``Tag.scope`` under another name; it, too, must be written where it is used."""
    raise errors.primitive("must be called as `scopeTag' in the scope that it is for")


@TABLE.primitive("system")
def system(world: World, this: Any, command: str) -> int:
    """Run a shell command and wait for its end, while other jobs go on.

    Returns the status as the operating system tells it: the exit code times 256, or the signal that ended it.
    """
    if "\0" in command:
        raise errors.primitive("commands cannot have a null character in them")
    code = Child(world, lambda group: subprocess.Popen(command, shell=True, process_group=group)).wait()
    return code << 8 if code >= 0 else -code


def _vendor() -> str:
    if sys.platform == "darwin":
        return "apple"
    return "pc" if platform.machine() in ("i386", "i686", "x86_64", "AMD64") else "unknown"


def _system_name() -> str:
    if sys.platform == "darwin":
        return "darwin" + platform.release()
    return {"linux": "linux-gnu", "win32": "mingw32"}.get(sys.platform, sys.platform)


def install(world: World, programs: Any) -> None:
    """Describe the machine; and the Urbi SDK, whose language this is."""
    windows = sys.platform == "win32"
    cpu, vendor, name = platform.machine() or "unknown", _vendor(), _system_name()
    machine = {
        "host": f"{cpu}-{vendor}-{name}",
        "hostAlias": "",
        "hostCpu": cpu,
        "hostOs": name,
        "hostVendor": vendor,
        "isWindows": windows,
        "kind": "WIN32" if windows else "POSIX",
    }
    package = {"copyrightHolder": "Gostai S.A.S.", "copyrightYears": "2005-2010"}
    for path, slots in (("System.Platform", machine), ("System.PackageInfo", package)):
        for slot, value in slots.items():
            constant(prototype(world, path), slot, world.from_python(value))
    table = Table("System")

    @table.primitive("reboot")
    def reboot(world: World, this: Any) -> None:
        """End the server as ``shutdown`` does and start it anew with the same arguments; an error if whoever started
        it did not prepare for that."""
        if programs.reboot is None:
            raise errors.primitive("this server cannot start itself anew: use shutdown, and start it again")
        programs.reboot()

    @table.primitive("_exit")
    def exit_(world: World, this: Any, status: int) -> None:
        """End the server as ``shutdown`` does, with this exit code; what follows is not run."""
        # The manual has it end brutally.  A robot is served here, and others are connected: they are not left so.
        programs.exit(status)
        world.scheduler.suspend(None)

    table.install(world, prototype(world, "System"))
