"""One top-level statement from its node to its unit."""

from __future__ import annotations

import ast as pyast
import copy
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import partial

from urbihw.kernel import errors
from urbihw.kernel.compiler.bind import bind
from urbihw.kernel.compiler.codegen import write_unit
from urbihw.kernel.compiler.pieces import code_of, cut
from urbihw.kernel.compiler.unit import CompiledUnit
from urbihw.kernel.recursion import set_recursion_limit
from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.binding import UNBOUND
from urbihw.kernel.syntax.pace import StepPace

EXTRA_CALLS = 7000
"""Additional Python calls that the compiler may nest."""


def compile_node(
    node: ast.Node,
    lazy_names: Iterable[str] = (),
    *,
    late: Iterable[str] = (),
    generic: bool = False,
    keep_tree: bool = False,
    pace: StepPace | None = None,
) -> CompiledUnit:
    """Compile one top-level statement.  With a ``pace``, the work pauses and long functions are cut.

    ``lazy_names`` are the names known to belong to lazy functions; ``late`` are local variables reached through
    ``FrameLocals`` (see ``late``); ``generic`` sends arithmetic as messages, because a program has redefined an
    operator of Float.  Raises ``TooDeep``: beyond a thousand levels of expressions, or some hundreds of functions or
    loops; ``StatementTooLong``: code that cannot be cut into short pieces, or captures too many variables.
    """

    compiled = partial(_compile, lazy_names=lazy_names, late=late, generic=generic, keep_tree=keep_tree, pace=pace)
    try:
        if late or node.bound is not UNBOUND:
            # Another job may be in the middle of compiling the statement that contains the node.
            with _deep():
                node = copy.deepcopy(node)
        try:
            return compiled(node, apart=False)
        except (SyntaxError, errors.TooDeep):  # too many nested loops and the like
            return compiled(node, apart=True)
    except SyntaxError:
        raise errors.TooDeep from None
    except RecursionError:
        if _depth() > sys.getrecursionlimit() // 2:  # the program itself has reached the limit, by ``eval``
            raise
        raise errors.TooDeep from None


def _compile(
    node: ast.Node,
    *,
    lazy_names: Iterable[str],
    late: Iterable[str],
    generic: bool,
    keep_tree: bool,
    pace: StepPace | None,
    apart: bool,
) -> CompiledUnit:
    """``compile_node``; with ``apart`` loops, tags and ``try`` deep inside others are functions of their own.

    Raises SyntaxError if the nesting is too deep for Python.
    """
    steps = StepPace() if pace is None else pace
    with _deep():
        binding = bind(node, lazy_names, late, apart, steps)
        try:
            function, writer = write_unit(node, binding, generic, steps)
            binding.release(steps)
        finally:
            binding.release()
    pieces = [] if pace is None else cut(function, pace)
    tree = pyast.Module([function], []) if keep_tree else None
    entries = writer.entries
    return CompiledUnit(
        code_of(function), lambda: entries, writer.has_bounced, writer.constants, writer.syntax, pieces, tree
    )


@contextmanager
def _deep() -> Iterator[None]:
    """Let the recursive functions of the compiler go deeper than programs may: they take no C stack."""
    usual = set_recursion_limit(sys.getrecursionlimit() + EXTRA_CALLS)
    try:
        yield
    finally:
        sys.setrecursionlimit(usual)


def _depth() -> int:
    """The present depth of the Python stack."""
    depth, frame = 0, sys._getframe()
    while frame.f_back is not None:
        depth, frame = depth + 1, frame.f_back
    return depth
