"""Which urbiscript operators Python's own serve, and the names of the others in generated code."""

from __future__ import annotations

import ast as py
from typing import Final

from urbihw.kernel.syntax import ast

ARITHMETIC: Final = {"+": py.Add, "-": py.Sub, "*": py.Mult, "/": py.Div}
COMPARISONS: Final = {"<": py.Lt, "<=": py.LtE, ">": py.Gt, ">=": py.GtE}
INPLACE: Final = {"+=": py.Add, "-=": py.Sub, "*=": py.Mult, "/=": py.Div}
EQUALITY: Final = {"==": "equal", "!=": "unequal"}
CONSTANTS: Final = {"true": "TRUE", "false": "FALSE", "nil": "NIL", "void": "VOID"}
BINARY: Final = frozenset((*ARITHMETIC, *COMPARISONS, *EQUALITY, "===", "!==", "<<"))


def is_native(node: ast.Call) -> bool:
    """Whether a call is an operation that Python's own operators serve, unless those of Float were redefined."""
    if node.target is None:
        return False
    if not node.args:
        return node.name == "!" or (node.name == "-" and node.args is None)
    return len(node.args) == 1 and node.name in BINARY


def is_equality(node: ast.Call) -> bool:
    """Whether a call is ``==`` or ``!=`` as an operator."""
    return node.name in EQUALITY and node.args is not None and len(node.args) == 1
