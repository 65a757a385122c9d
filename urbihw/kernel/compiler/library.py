"""Compiled programs on the disk, so that starting does not parse the library.

A program is found again by everything it depends on: its text, the names known to be lazy when it was compiled, the
Python version, and the sources of the compiler itself.  A cache that cannot be read or written is done without.
"""

from __future__ import annotations

import contextlib
import hashlib
import logging
import marshal
import os
import pickle
import sys
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from urbihw.kernel.compiler.linemap import Entry
from urbihw.kernel.compiler.unit import FunctionInfo, Syntax, Unit
from urbihw.kernel.syntax.location import Position, Span

log = logging.getLogger("urbihw.kernel")


class Compiled(NamedTuple):
    """One statement of a program: its unit, where it stood, the separator behind it."""

    unit: Unit
    base: Position
    separator: str


def cache_dir() -> Path:
    """Where compiled programs are kept (XDG base directories)."""
    root = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    return Path(root) / "urbihw"


@lru_cache(maxsize=1)
def _compiler_state() -> bytes:
    """What changes when the compiler does: its sources and those of the syntax."""
    digest = hashlib.sha256(sys.version.encode())
    here = Path(__file__).parent
    for folder in (here, here.parent / "syntax"):
        for path in sorted(folder.glob("*.*")):
            if path.suffix in (".py", ".lark"):
                status = path.stat()
                digest.update(f"{path.name} {status.st_size} {status.st_mtime_ns}".encode())
    return digest.digest()


def key_of(text: str, lazy_names: Iterable[str]) -> str:
    """The name under which a program is kept."""
    digest = hashlib.sha256(_compiler_state())
    digest.update(repr(sorted(lazy_names)).encode())
    digest.update(text.encode("latin-1", "replace"))
    return digest.hexdigest()[:32]


def load(key: str) -> list[Compiled] | None:
    """The compiled program kept under a name, or None."""
    try:
        packed = pickle.loads((cache_dir() / f"{key}.bin").read_bytes())
        return [_unpack(*parts) for parts in packed]
    except FileNotFoundError:
        return None
    except Exception as error:
        log.debug("compiled library not used: %s", error)
        return None


def store(key: str, program: list[Compiled]) -> None:
    """Keep a compiled program; silently not, where the place cannot be written."""
    with contextlib.suppress(OSError):
        folder = cache_dir()
        folder.mkdir(parents=True, exist_ok=True)
        scratch = folder / f"{key}.{os.getpid()}.tmp"
        scratch.write_bytes(pickle.dumps([_pack(part) for part in program], pickle.HIGHEST_PROTOCOL))
        scratch.replace(folder / f"{key}.bin")


_Entries = list[tuple[tuple[int, ...], str | None, int]]
_Packed = tuple[bytes, _Entries, list[tuple[object, ...]], bytes, tuple[object, ...], str]


def _pack(part: Compiled) -> _Packed:
    unit = part.unit
    entries = [(tuple(entry.span), entry.name, entry.outer) for entry in unit.entries]
    infos: list[tuple[object, ...]] = [
        (info.least, info.most, info.lazy, info.uses_call, info.closure, info.formals, info.index)
        for info in unit.constants
    ]
    return marshal.dumps(unit.code), entries, infos, unit.syntax.pack(), tuple(part.base), part.separator


def _unpack(code: bytes, entries: list[tuple[tuple[int, int, int, int], str | None, int]],
            infos: list[tuple[int, int, bool, bool, bool, int, int]], syntax: bytes,
            base: tuple[int, int, str | None], separator: str) -> Compiled:
    cold = Syntax(packed=syntax)
    table = [Entry(Span(*span), name, outer) for span, name, outer in entries]
    constants = [FunctionInfo(*info[:6], cold, info[6]) for info in infos]
    return Compiled(Unit(marshal.loads(code), table, constants, cold, []), Position(*base), separator)
