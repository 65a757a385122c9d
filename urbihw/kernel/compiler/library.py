"""Compiled programs on disk, so that a start parses neither the library nor the files of users.

The key of a program covers all that its code depends on: its text, the names known to be lazy when it was compiled, the
Python version, and the sources of the compiler itself.  ``syntax.cache_folder`` defines which files are trusted.
"""

from __future__ import annotations

import hashlib
import logging
import marshal
import sys
from collections.abc import Iterable
from functools import cache, lru_cache, partial
from pathlib import Path
from typing import NamedTuple

from urbihw.kernel.compiler.linemap import MappedPlace
from urbihw.kernel.compiler.unit import CompiledUnit, CompilerState, FunctionInfo, Syntax
from urbihw.kernel.syntax.cache_folder import read_cached, write_cached
from urbihw.kernel.syntax.location import Position, Span

log = logging.getLogger("urbihw.kernel")


class Compiled(NamedTuple):
    """One statement of a program: its unit, its position, and the separator after it."""

    unit: CompiledUnit
    base: Position
    separator: str


@lru_cache(maxsize=1)
def _compiler_state() -> bytes:
    """The sources of the compiler and of the syntax, of which the key depends."""
    digest = hashlib.sha256(sys.version.encode())
    here = Path(__file__).parent
    for folder in (here, here.parent / "syntax"):
        for path in sorted(folder.glob("*.*")):
            if path.suffix in (".py", ".lark"):
                status = path.stat()
                digest.update(f"{path.name} {status.st_size} {status.st_mtime_ns}".encode())
    return digest.digest()


def key_of(text: str, lazy_names: Iterable[str]) -> str:
    """The key of a program."""
    digest = hashlib.sha256(_compiler_state())
    digest.update(repr(sorted(lazy_names)).encode())
    digest.update(text.encode("latin-1", "replace"))
    return digest.hexdigest()[:32]


class LibraryPart(NamedTuple):
    """One statement of a program on the disk: ``state`` is the compiler's state for it, in addition to the key."""

    state: CompilerState
    packed: bytes


def load_parts(key: str) -> list[LibraryPart]:
    """The stored statements of a program; an empty list if it is not stored."""
    content = read_cached(f"{key}.bin")
    try:
        return [] if content is None else [LibraryPart(*part) for part in marshal.loads(content)]
    except Exception as error:
        log.debug("compiled program not used: %s", error)
        return []


def store_parts(key: str, parts: list[LibraryPart]) -> None:
    """Store a program; does nothing where the folder cannot be written."""
    write_cached(f"{key}.bin", marshal.dumps([tuple(part) for part in parts]))


def load(key: str) -> list[Compiled] | None:
    """The stored program, or None."""
    try:
        return [unpack(part.packed) for part in load_parts(key)] or None
    except Exception as error:
        log.debug("compiled library not used: %s", error)
        return None


def store(key: str, program: list[Compiled]) -> None:
    """Store a compiled program whose statements were compiled in the state of the key."""
    store_parts(key, [LibraryPart((frozenset(), False), pack(part)) for part in program])


def pack(part: Compiled) -> bytes:
    """Serialize a statement for the disk."""
    unit = part.unit
    entries = marshal.dumps([(tuple(entry.span), *entry[1:]) for entry in unit.entries()])
    infos: list[tuple[object, ...]] = [
        (info.least, info.most, info.lazy, info.uses_call, info.closure, info.formals, info.index)
        for info in unit.constants
    ]
    table = (entries, unit.has_bounced)
    content = (unit.code, unit.pieces, table, infos, unit.syntax.pack(), tuple(part.base), part.separator)
    return marshal.dumps(content)


def unpack(packed: bytes) -> Compiled:
    """Deserialize a statement; may raise any error for data that ``pack`` has not made."""
    code, pieces, (entries, has_bounced), infos, syntax, base, separator = marshal.loads(packed)
    cold = Syntax(packed=syntax)
    constants = [
        FunctionInfo(least, most, lazy, uses_call, closure, formals, cold, index)
        for least, most, lazy, uses_call, closure, formals, index in infos
    ]
    unit = CompiledUnit(code, cache(partial(_table, entries)), has_bounced, constants, cold, pieces)
    return Compiled(unit, Position(*base), separator)


def _table(entries: bytes) -> list[MappedPlace]:
    """The table of a line map."""
    return [MappedPlace(Span(*span), *rest) for span, *rest in marshal.loads(entries)]
