"""Scopes, and the results of ``bind`` for a statement as a whole."""

from __future__ import annotations

from collections.abc import Iterable

from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.binding import UNBOUND, BoundNode, FunctionFrame, Local
from urbihw.kernel.syntax.pace import StepPace


class NameScope:
    """Names to locals; with ``slots`` a plain ``var`` makes a slot of this, a ``block`` may own a scope tag."""

    __slots__ = ("block", "frame", "names", "outer", "slots")

    def __init__(self, outer: NameScope | None, frame: FunctionFrame, slots: bool, block: bool = False) -> None:
        self.outer = outer
        self.block = block
        self.frame = frame
        self.slots = slots
        self.names: dict[str, Local] = {}


class Binding:
    """The results of ``bind``; most of them are stored on the nodes."""

    __slots__ = ("lazy_names", "nodes", "top")

    def __init__(self, lazy_names: Iterable[str]) -> None:
        self.lazy_names = set(lazy_names)
        """The names known to belong to lazy functions."""
        self.nodes: list[ast.Node] = []
        """The nodes with results."""
        self.top = FunctionFrame(None)
        """The statement itself."""

    def bound(self, node: ast.Node) -> BoundNode:
        """The results for a node."""
        bound = node.bound
        if bound is UNBOUND:
            bound = BoundNode()
            node.bound = bound  # type: ignore[misc]  # what may change of a node
            self.nodes.append(node)
        return bound

    def release(self, pace: StepPace | None = None) -> None:
        """Remove the results from the nodes; the binding cannot be used any more.

        The work pauses by the ``pace``; if a pause raises, another call does the rest.
        """
        nodes = self.nodes
        while nodes:
            nodes.pop().bound = UNBOUND  # type: ignore[misc]
            if pace is not None and not len(nodes) % 32:
                pace.step()


OPERATIONS = (ast.Call, ast.And, ast.Or)


def spine(node: ast.Node, pace: StepPace, kinds: tuple[type[ast.Node], ...] = OPERATIONS) -> list[ast.Node]:
    """A node, its left operand, the left operand of that, and so on, as long as they are of the given kinds.

    ``a + b - c`` is the subtraction and the addition.  Long sums are deep at the left, so recursion over them would be
    too deep.
    """
    found = []
    at: ast.Node | None = node
    while at is not None and isinstance(at, kinds):
        pace.step()
        found.append(at)
        at = left_of(at)
    return found


def left_of(node: ast.Node) -> ast.Node | None:
    """The left operand of an operation."""
    if isinstance(node, ast.Call):
        return node.target
    return node.left if isinstance(node, ast.And | ast.Or) else None


def binding_names(patterns: Iterable[ast.Node]) -> list[str]:
    """The names bound by patterns, in the order of the source."""
    names: list[str] = []
    for node in patterns:
        if is_binding(node):
            assert isinstance(node, ast.Var)
            names.append(node.name)
        elif isinstance(node, ast.ListLit | ast.TupleLit):
            names += binding_names(node.items)
        elif isinstance(node, ast.DictLit):
            names += binding_names(item for _, item in node.pairs)
    return names


def is_binding(node: ast.Node) -> bool:
    """Whether a pattern is ``var x``."""
    return isinstance(node, ast.Var) and node.target is None and node.value is None
