"""The urbiscript operators that Python operators implement, and the names of the others in generated code."""

from __future__ import annotations

import ast as py
from typing import Final

from urbihw.kernel.syntax import ast

ARITHMETIC: Final = {"+": py.Add, "-": py.Sub, "*": py.Mult, "/": py.Div}
COMPARISONS: Final = {"<": py.Lt, "<=": py.LtE, ">": py.Gt, ">=": py.GtE}
INPLACE: Final = {"+=": py.Add, "-=": py.Sub, "*=": py.Mult, "/=": py.Div}
EQUALITY: Final = {"==": "equal", "!=": "unequal"}
VERBS: Final = {"<<": "push", "%": "remainder"}
"""Operators that functions of the runtime implement, because Python's differ."""
CONSTANTS: Final = {"true": "TRUE", "false": "FALSE", "nil": "NIL", "void": "VOID"}
LOGICAL: Final = frozenset(("!", "&&", "||"))
"""The operators that are not sent as messages, unless a program has redefined them: then they are lazy names."""
BINARY: Final = frozenset((*ARITHMETIC, *COMPARISONS, *EQUALITY, "===", "!==", *VERBS))


def operator_of(node: ast.And | ast.Or) -> str:
    """The name of a choice as a message."""
    return "&&" if isinstance(node, ast.And) else "||"


def is_native(node: ast.Call) -> bool:
    """Whether a call is an operation that a Python operator implements, unless those of Float were redefined."""
    if node.target is None or node.bound.lazy:
        return False
    if not node.args:
        return node.name == "!" or (node.name == "-" and node.args is None)
    return len(node.args) == 1 and node.name in BINARY


def is_equality(node: ast.Call) -> bool:
    """Whether a call is ``==`` or ``!=`` as an operator."""
    return node.name in EQUALITY and node.args is not None and len(node.args) == 1 and not node.bound.lazy
