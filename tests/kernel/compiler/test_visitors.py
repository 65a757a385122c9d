"""The tables of visitors: each class of nodes is compiled in one way."""

from __future__ import annotations

from urbihw.kernel.compiler.bind import VISITORS
from urbihw.kernel.compiler.codegen import EXPRESSIONS, STATEMENTS
from urbihw.kernel.syntax import ast

PARTS = {ast.Formal, ast.Case, ast.Catch, ast.EventCond, ast.ExprCond}
"""What is compiled as a part of others."""


def test_each_class_of_nodes_has_one_visitor() -> None:
    kinds = {kind for kind in ast.Node.__subclasses__() if kind.__module__ == ast.__name__}
    assert EXPRESSIONS.keys() & STATEMENTS.keys() == set()
    assert EXPRESSIONS.keys() | STATEMENTS.keys() == kinds - PARTS
    assert kinds >= VISITORS.keys()
