"""A command under the restrictions of the unit: by systemd where it runs, else by bubblewrap and libseccomp.

The second way applies of the unit and the drop-in of a platform: the system calls, kinds of sockets, namespaces and
write-execute rules as a seccomp filter; an empty set of capabilities and no new privileges; a file system that is
read-only but for the folders of the service; hidden homes; a /dev with nothing but null, pseudo-terminals and the
devices of the platform that this machine has.  It keeps the user, since the Python of the tests may be in that user's
home.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import errno
import os
import re
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import IO, Final

SYSTEMD: Final = Path("/run/systemd/system")
_ALLOW: Final = 0x7FFF0000
_ERRNO: Final = 0x00050000
_EQ, _MASKED_EQ = 4, 7
_WRITE, _EXEC = 2, 4
_NEW_NAMESPACES: Final = 0x7E020080
"""All CLONE_NEW flags of ``man 2 clone``."""
_PASSED: Final = re.compile(
    "AmbientCapabilities|CapabilityBoundingSet|DeviceAllow|DevicePolicy|Lock.*|Memory.*|NoNew.*|Private.*|Protect.*|"
    "Limit.*|Remove.*|Restrict.*|SystemCall.*|TasksMax|UMask"
)
"""Settings of the unit that restrict the service."""


def settings(*texts: str) -> list[tuple[str, str]]:
    """The settings of the [Service] sections of a unit and its drop-ins, in order."""
    found = []
    for text in texts:
        section = ""
        for line in text.splitlines():
            if line.startswith("["):
                section = line
            elif section == "[Service]" and "=" in line and not line.startswith("#"):
                key, _, value = line.partition("=")
                found.append((key, value))
    return found


def reason_to_skip() -> str:
    """Why no sandbox can be made here; "" if one can."""
    if SYSTEMD.is_dir():
        return "" if os.geteuid() == 0 else "systemd-run needs root"
    if not (shutil.which("bwrap") and shutil.which("systemd-analyze") and ctypes.util.find_library("seccomp")):
        return "no systemd, and no bubblewrap, systemd-analyze and libseccomp in its place"
    tried = subprocess.run(("bwrap", "--ro-bind", "/", "/", "true"), capture_output=True, check=False)
    return "" if tried.returncode == 0 else "bubblewrap may not make namespaces here"


def words(
    rows: Sequence[tuple[str, str]], writable: Path, environment: Mapping[str, str], filter_file: IO[bytes]
) -> list[str]:
    """The words before a command that runs it in the sandbox; ``writable`` stands for the folders of the service."""
    readable = sorted({Path(sys.prefix), Path(sys.base_prefix), Path(__file__).parents[2]})
    if SYSTEMD.is_dir():
        given = [word for key, value in rows if _PASSED.fullmatch(key) for word in ("-p", f"{key}={value}")]
        seen = [word for path in readable for word in ("-p", f"BindReadOnlyPaths={path}")]
        given += [f"--setenv={name}={value}" for name, value in environment.items()]
        kept = ("-p", f"BindPaths={writable}", "-p", f"ReadWritePaths={writable}")
        return ["systemd-run", "--quiet", "--wait", "--pipe", *given, *seen, *kept]
    _write_filter(rows, filter_file)
    made = ["bwrap", "--ro-bind", "/", "/", "--proc", "/proc", "--dev", "/dev"]
    for hidden in ("/home", "/root", "/tmp"):
        made += ["--tmpfs", hidden]
    for path in readable:
        made += ["--ro-bind", str(path), str(path)]
    for key, value in rows:
        if key == "DeviceAllow":
            made += [word for path in _nodes(value.split()[0]) for word in ("--dev-bind", path, path)]
    made += ["--bind", str(writable), str(writable), "--unshare-pid", "--die-with-parent", "--cap-drop", "ALL"]
    return [*made, "--seccomp", str(filter_file.fileno())]


def _nodes(device: str) -> list[str]:
    """The nodes of this machine for an entry of ``DeviceAllow``, but for those that bubblewrap makes."""
    if device.startswith("/dev/") or device == "char-pts":
        return []
    if device == "char-usb_device":
        return ["/dev/bus/usb"] if Path("/dev/bus/usb").is_dir() else []
    return sorted(map(str, Path("/dev").glob(device.removeprefix("char-") + "*")))


# ---------------------------------------------------------------- seccomp


class _Compare(ctypes.Structure):
    """``struct scmp_arg_cmp`` of ``man 3 seccomp_rule_add``."""

    _fields_ = [("arg", ctypes.c_uint), ("op", ctypes.c_int), ("a", ctypes.c_uint64), ("b", ctypes.c_uint64)]


def _system_calls(rows: Iterable[tuple[str, str]]) -> set[str]:
    """The names of the calls that ``SystemCallFilter`` lets through."""
    allowed: set[str] = set()
    for key, value in rows:
        if key == "SystemCallFilter":
            names = {name for group in value.lstrip("~").split() for name in _members(group)}
            allowed = allowed - names if value.startswith("~") else allowed | names
    return allowed


def _members(group: str) -> set[str]:
    if not group.startswith("@"):
        return {group}
    shown = subprocess.run(("systemd-analyze", "syscall-filter", "--no-pager", group), capture_output=True, text=True,
                           check=True).stdout.splitlines()[1:]
    rows = [row.strip() for row in shown if row.strip() and not row.strip().startswith("#")]
    return {name for row in rows for name in _members(row)}


def _write_filter(rows: Sequence[tuple[str, str]], file: IO[bytes]) -> None:
    """Write the seccomp filter of the settings as a program of the kernel."""
    library = ctypes.CDLL(ctypes.util.find_library("seccomp"))
    library.seccomp_init.restype = ctypes.c_void_p
    context = ctypes.c_void_p(library.seccomp_init(_ERRNO | errno.EPERM))
    families = {word for key, value in rows if key == "RestrictAddressFamilies" for word in value.split()}
    flags = {key for key, value in rows if value == "yes"}
    rules: dict[str, list[tuple[int, int, int, int]]] = {
        "socket": [(0, _EQ, int(getattr(socket, family)), 0) for family in sorted(families)],
    }
    if "RestrictNamespaces" in flags:
        rules |= {"clone": [(0, _MASKED_EQ, _NEW_NAMESPACES, 0)], "unshare": [], "setns": [], "clone3": []}
    if "MemoryDenyWriteExecute" in flags:
        rules["mmap"] = [(2, _MASKED_EQ, _WRITE | _EXEC, kept) for kept in (0, _WRITE, _EXEC)]
        rules |= {name: [(2, _MASKED_EQ, _EXEC, 0)] for name in ("mprotect", "pkey_mprotect")}
    for name in sorted(_system_calls(rows)):
        number = library.seccomp_syscall_resolve_name(name.encode())
        if number < 0:  # of another kind of machine
            continue
        compared = [(_Compare * 1)(_Compare(*row)) for row in rules[name]] if name in rules else [None]
        for compare in compared:
            done = library.seccomp_rule_add_array(context, _ALLOW, number, int(compare is not None), compare)
            assert done == 0, (name, done)
    # As systemd does it: the C library then takes clone, whose flags a filter can see.
    number = library.seccomp_syscall_resolve_name(b"clone3")
    assert library.seccomp_rule_add_array(context, _ERRNO | errno.ENOSYS, number, 0, None) == 0
    assert library.seccomp_export_bpf(context, file.fileno()) == 0
    library.seccomp_release(context)
    file.seek(0)
