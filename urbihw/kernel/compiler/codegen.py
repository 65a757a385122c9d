"""The code generator: one top-level statement to one Python function of ``this``."""

from __future__ import annotations

import ast as py

from urbihw.kernel.compiler.concurrency import Concurrency
from urbihw.kernel.compiler.emit import RETURN, function
from urbihw.kernel.compiler.late import LateSites, Names
from urbihw.kernel.compiler.scopes import Binding
from urbihw.kernel.compiler.unit import Syntax
from urbihw.kernel.syntax import ast


class Codegen(Concurrency):
    """Write one statement; afterwards ``entries``, ``constants`` and ``syntax`` belong to the unit."""

    def __init__(self, binding: Binding, generic: bool) -> None:
        super().__init__(binding, generic)
        self.late = LateSites()
        self._late_names: dict[int, Names] = {}
        self.syntax = Syntax([], self.late)

    def late_site(self, node: ast.Call) -> int:
        """Remember a call whose function may turn out to be lazy."""
        return self.late.add(node, self.binding, self._late_names)

    def statement(self, node: ast.Node) -> py.Module:
        """A module with one function, ``statement(this)``."""
        p = self.mark(node)
        body = self.block(lambda: self.scope_tagged(node, lambda: self.stmt(node, RETURN), p))
        this = self.binding.top_this.python
        return py.Module([function("statement", [this], body, p)], [])
