"""A compiled top-level statement, and how it is run."""

from __future__ import annotations

import ast as pyast
import pickle
from collections.abc import Callable
from dataclasses import dataclass, field
from types import CodeType, FunctionType
from typing import Any

from urbihw.frozen import frozen
from urbihw.kernel.compiler.late import LateSites
from urbihw.kernel.compiler.linemap import LineMap, MappedPlace
from urbihw.kernel.compiler.pieces import Linker
from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.location import Position

CompilerState = tuple[frozenset[str], bool]
"""What code depends on beside its text: the names known to belong to lazy functions, and whether arithmetic is sent as
messages."""


class Syntax:
    """The parts of a unit's source that are seldom needed: the syntax of its functions and lazy arguments, and the
    calls whose functions may be lazy.  A unit from disk unpacks them when they are needed.
    """

    __slots__ = ("_content", "_packed")

    def __init__(self, nodes: list[Any] | None = None, late: LateSites | None = None, packed: bytes | None = None):
        self._content = None if nodes is None else (nodes, late)
        self._packed = packed

    def __getitem__(self, index: int) -> Any:
        """The syntax remembered under a number."""
        return self._load()[0][index]

    @property
    def late(self) -> Any:
        """The ``LateSites`` of the unit."""
        return self._load()[1]

    def add(self, node: Any) -> int:
        """Remember some syntax; its number."""
        nodes = self._load()[0]
        nodes.append(node)
        return len(nodes) - 1

    def pack(self) -> bytes:
        """The syntax as bytes, for the disk."""
        return pickle.dumps(self._load(), pickle.HIGHEST_PROTOCOL)

    def _load(self) -> tuple[list[Any], Any]:
        if self._content is None:
            assert self._packed is not None
            self._content = pickle.loads(self._packed)
            self._packed = None
        return self._content


@frozen
class FunctionInfo:
    """The description of a function literal.

    ``least``/``most`` are the numbers of arguments (most -1: any), ``lazy`` has no formals, ``uses_call`` needs the
    call message, ``syntax`` and ``index`` locate its source.
    """

    least: int
    most: int
    lazy: bool
    uses_call: bool
    closure: bool
    formals: int
    syntax: Syntax
    index: int

    @property
    def node(self) -> ast.Function:
        """The literal's syntax, for printing and comparing."""
        node = self.syntax[self.index]
        assert isinstance(node, ast.Function)
        return node


@dataclass(slots=True)
class CompiledUnit:
    """Generated code of one statement; may be run many times, at different places.

    ``entries`` returns the table of its ``LineMap``, ``has_bounced`` is whether some of it are arguments of calls that
    bounce to the lobby.
    """

    code: CodeType
    entries: Callable[[], list[MappedPlace]]
    has_bounced: bool
    constants: list[FunctionInfo]
    syntax: Syntax
    pieces: list[CodeType]
    tree: pyast.Module | None = field(default=None, repr=False)

    def function(
        self, ops: dict[str, Any], base: Position, system: bool = False, late_locals: Any = None
    ) -> Callable[[Any], Any]:
        """The statement as a Python function of ``this``; ``ops`` are the verbs generated code calls by name."""
        line_map = LineMap(self.entries, self.has_bounced, base, system, self.syntax)
        names = {
            "__builtins__": ops,
            "__urbi__": line_map,
            "_K": self.constants,
            "_N": self.syntax,
            "_L": late_locals,
        }
        if self.pieces:
            names["_P"] = Linker(self.pieces)
        return FunctionType(self.code, names)
