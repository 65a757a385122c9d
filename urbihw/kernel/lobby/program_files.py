"""Cached code of files for ``load``: the next start finds the compiled code in the cache folder, as Python does for
modules.

The key consists of the name and the text of the file and of the additions of ``library.key_of``.  The code of a
statement also depends on the effects of earlier statements: whether arithmetic is generic and which names are lazy.
This state is stored with each statement; where it differs, this statement and the following ones are compiled again.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

from urbihw.kernel.compiler import library
from urbihw.kernel.syntax.reader import Statement

if TYPE_CHECKING:
    from urbihw.kernel.lobby.shell import Programs

log = logging.getLogger("urbihw.kernel")

MIN_TEXT_LENGTH: Final = 2000
"""Minimum length of a cached text, in characters: a shorter one is compiled in 20 ms."""
MAX_TEXT_LENGTH: Final = 300_000
"""Maximum length of a cached text, in characters: its code is read without a pause, in 20 ms."""
MAX_STATEMENT_LENGTH: Final = 20_000
"""Maximum length of a statement of a cached program, in characters: its code is read and written without a pause."""


def is_kept(text: str) -> bool:
    """Whether the code of a text is cached: it is neither short nor very long."""
    return MIN_TEXT_LENGTH <= len(text) <= MAX_TEXT_LENGTH


def compiled_file(programs: Programs, text: str, file: str) -> Iterator[library.Compiled]:
    """The statements of a file, each compiled, or read from the cache folder, when the one before it has been run.

    Raises Exception.Syntax before the first statement, as reading the text does.  Must be called in a job.
    """
    key = library.key_of(f"{file}\n{text}", programs.world.lazy_names.shared)
    known = library.load_parts(key)
    parts: list[library.LibraryPart] = []
    for part in known:
        if part.state != programs.compiler_state:
            break
        try:
            compiled = library.unpack(part.packed)
        except Exception as error:  # damaged
            log.debug("compiled file not used: %s", error)
            break
        parts.append(part)
        yield compiled
    else:
        if known:
            return
    items = programs.parse(text, file)
    total = len(items)
    keep = all(isinstance(item, Statement) and len(item.text) <= MAX_STATEMENT_LENGTH for item in items)
    state = programs.compiler_state
    for compiled in programs.compiled(items[len(parts) :], text, programs.compile_statement):
        keep = keep and state == programs.compiler_state  # another job ran meanwhile
        if keep:
            parts.append(library.LibraryPart(state, library.pack(compiled)))
            if len(parts) == total:
                library.store_parts(key, parts)
        yield compiled
        state = programs.compiler_state
