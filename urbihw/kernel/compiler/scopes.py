"""Locals, frames, scopes: what ``bind`` finds out about a statement (see there for the theory)."""

from __future__ import annotations

from collections.abc import Iterable

from urbihw.kernel import errors
from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.pace import Pace

MOST_FRAMES = 250
"""How deep functions may nest; the time that Python takes to compile them grows with the square of it."""


class Local:
    """One local variable."""

    __slots__ = ("assigned", "captured", "const", "fresh", "frame", "late", "maybe_void", "name", "python")

    def __init__(self, name: str, python: str, frame: Frame, fresh: bool) -> None:
        self.name = name
        self.python = python
        self.frame = frame
        self.fresh = fresh
        self.captured = False
        self.assigned = False
        self.maybe_void = False
        self.late = False
        self.const = False

    @property
    def boxed(self) -> bool:
        """Whether it lives in a Box."""
        return self.captured and self.assigned


class Frame:
    """One Python function to be."""

    __slots__ = ("counter", "depth", "free", "function", "loops", "parent", "returns_through", "uses_call")

    def __init__(self, parent: Frame | None, function: ast.Function | None) -> None:
        """Raises TooDeep."""
        self.parent = parent
        self.depth: int = 0 if parent is None else parent.depth + 1
        if self.depth > MOST_FRAMES:
            raise errors.TooDeep
        self.function = function
        self.free: dict[Local, None] = {}
        self.loops = 0
        self.counter: dict[str, int] = {}
        self.uses_call = False
        self.returns_through = False

    def unique(self, name: str) -> str:
        """A Python name for an urbiscript one, unique from here outwards."""
        clean = "".join(c if c.isalnum() and c.isascii() else "_" for c in name)
        top = self
        while top.parent is not None:
            top = top.parent
        count = top.counter.get(clean, 0)
        top.counter[clean] = count + 1
        return f"{clean}_{count}" if count else f"{clean}_"


class Scope:
    """Names to locals; with ``slots`` a plain ``var`` makes a slot of this, a ``block`` may own a scope tag."""

    __slots__ = ("block", "frame", "names", "outer", "slots")

    def __init__(self, outer: Scope | None, frame: Frame, slots: bool, block: bool = False) -> None:
        self.outer = outer
        self.block = block
        self.frame = frame
        self.slots = slots
        self.names: dict[str, Local] = {}


class Binding:
    """What ``bind`` found: locals by the node that names them, frames by the node that is their body."""

    def __init__(self) -> None:
        self.locals: dict[int, Local] = {}
        self.this: dict[int, Local] = {}
        self.frames: dict[int, Frame] = {}
        self.formals: dict[int, list[Local]] = {}
        self.patterns: dict[int, list[Local | None]] = {}
        self.lazy_names: set[str] = set()
        self.detaching: set[int] = set()
        """The bodies of loops that make jobs which go on by themselves, under the tags of their maker."""
        self.apart: set[int] = set()
        """The blocks that are functions of their own because they are too deep inside others."""
        self.scope_tags: dict[int, Local] = {}
        self.own_this: dict[int, Local] = {}
        self.own_call: dict[int, Local] = {}
        self.top: Frame = Frame(None, None)
        self.top_this: Local


OPERATIONS = (ast.Call, ast.And, ast.Or)


def spine(node: ast.Node, pace: Pace, kinds: tuple[type[ast.Node], ...] = OPERATIONS) -> list[ast.Node]:
    """A node, what stands at its left, what stands at the left of that, and so on, while it is one of some operations.

    ``a + b - c`` is the subtraction and the addition.  Long sums are deep at the left: who walks them must not recurse.
    """
    found = []
    at: ast.Node | None = node
    while at is not None and isinstance(at, kinds):
        pace.step()
        found.append(at)
        at = left_of(at)
    return found


def left_of(node: ast.Node) -> ast.Node | None:
    """What stands at the left of an operation."""
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
