"""The code generator: one top-level statement to one Python function of ``this``."""

from __future__ import annotations

import ast as py

from urbihw.kernel.compiler.concurrency import Concurrency
from urbihw.kernel.compiler.emit import RETURN, function
from urbihw.kernel.compiler.late import Known, LateSites
from urbihw.kernel.compiler.scopes import Binding
from urbihw.kernel.compiler.unit import Syntax
from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.pace import Pace


class Codegen(Concurrency):
    """Write one statement; afterwards ``entries``, ``constants`` and ``syntax`` belong to the unit."""

    def __init__(self, binding: Binding, generic: bool, pace: Pace) -> None:
        super().__init__(binding, generic, pace)
        self.late = LateSites()
        self._late_names: dict[int, Known] = {}
        self.syntax = Syntax([], self.late)

    def late_site(self, node: ast.Call) -> int:
        """Remember a call whose function may turn out to be lazy."""
        return self.late.add(node, self.binding, self._late_names, self.pace)

    def statement(self, node: ast.Node) -> py.FunctionDef:
        """The function ``statement(this)``."""
        p = self.mark(node)
        body = self.block(lambda: self.scope_tagged(node, lambda: self.stmt(node, RETURN), p))
        this = self.binding.top_this.python
        return function("statement", [this], body, p)
