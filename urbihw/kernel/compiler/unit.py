"""A compiled top-level statement, and how it is run."""

from __future__ import annotations

import ast as pyast
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from types import CodeType, FunctionType
from typing import Any

from urbihw.kernel.compiler.linemap import Entry, LineMap
from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.location import Position


@dataclass(frozen=True, slots=True)
class FunctionInfo:
    """What is known of a function literal without running it.

    ``least``/``most`` are the numbers of arguments (most -1: any), ``lazy`` has no formals, ``uses_call`` needs the
    call message, ``node`` is its syntax for printing and comparing.
    """

    least: int
    most: int
    lazy: bool
    uses_call: bool
    closure: bool
    formals: int
    node: ast.Function


@dataclass(slots=True)
class Unit:
    """Generated code of one statement; may be run many times, at different places."""

    code: CodeType
    entries: list[Entry]
    constants: list[Any]
    late: Any = None
    tree: pyast.Module | None = field(default=None, repr=False)

    def function(
        self, ops: dict[str, Any], base: Position, system: bool = False, late_locals: Any = None
    ) -> Callable[[Any], Any]:
        """The statement as a Python function of ``this``; ``ops`` are the verbs generated code calls by name."""
        line_map = LineMap(self.entries, base, system, self.late)
        names = {"__builtins__": ops, "__urbi__": line_map, "_K": self.constants, "_L": late_locals}
        return FunctionType(self.code, names)


def compile_node(
    node: ast.Node,
    lazy_names: Iterable[str] = (),
    *,
    late: Iterable[str] = (),
    generic: bool = False,
    keep_tree: bool = False,
) -> Unit:
    """Compile one top-level statement.

    ``lazy_names`` are the names known to belong to lazy functions; ``late`` are local variables reached through
    ``FrameLocals`` (see ``late``); ``generic`` sends arithmetic as messages, because somebody redefined an operator of
    Float.
    """
    from urbihw.kernel.compiler.bind import bind
    from urbihw.kernel.compiler.codegen import Codegen

    generator = Codegen(bind(node, lazy_names, late), generic)
    module = generator.statement(node)
    code = compile(module, "<urbiscript>", "exec", dont_inherit=True)
    inner = next(const for const in code.co_consts if isinstance(const, CodeType))
    return Unit(inner, generator.entries, generator.constants, generator.late, module if keep_tree else None)
