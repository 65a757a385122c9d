"""Compiler and runtime meet at one list: generated code uses the names in ops, all of them, and no others."""

from __future__ import annotations

import ast
from pathlib import Path

import urbihw.kernel.compiler as compiler
from urbihw.kernel.compiler.operations import CONSTANTS, EQUALITY, VERBS
from urbihw.kernel.runtime.ops import make_ops
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.sched.scheduler import Scheduler

COMPUTED = {
    *("at_expr", "at_event", "at_sync_expr", "at_sync_event", "whenever_expr", "whenever_event"),
    *("get_item", "set_item", "iterate", "times"),
    *CONSTANTS.values(),
    *EQUALITY.values(),
    *VERBS.values(),
}
"""Names that the compiler puts together from parts."""
LOCAL = {"_payload", "_v", "_t", "_c", "_l", "_s", "_m", "_p", "_once", "_each", "_this", "_K", "_N", "_L", "_P", "_q"}
"""Names of variables of the generated code itself."""


def emitted() -> set[str]:
    """The names in ``call("name", ...)`` and ``name("NAME", p)`` of the compiler's own sources."""
    found: set[str] = set()
    for path in Path(compiler.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name) or not node.args:
                continue
            if node.func.id in ("call", "name", "except_"):
                first = node.args[0]
                parts = [first.body, first.orelse] if isinstance(first, ast.IfExp) else [first]
                names = [part.value for part in parts if isinstance(part, ast.Constant)]
                found |= {name for name in names if isinstance(name, str)}
    return found


def unused(*words: object) -> None:
    """Only the names of the verbs are asked for."""


def test_every_name_exists_and_every_name_is_used() -> None:
    known = set(make_ops(World(Scheduler(SimClock())), unused, unused))
    used = {name for name in emitted() if name.isidentifier()} - LOCAL
    assert used - known - {";"} == set()
    assert known - used - COMPUTED == set()
