"""Locals, frames, scopes: what ``bind`` finds out about a statement (see there for the theory)."""

from __future__ import annotations

from collections.abc import Iterable

from urbihw.kernel.syntax import ast


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

    __slots__ = ("counter", "free", "function", "loops", "parent", "returns_through", "token_loops", "uses_call")

    def __init__(self, parent: Frame | None, function: ast.Function | None) -> None:
        self.parent = parent
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
        self.scope_tags: dict[int, Local] = {}
        self.own_this: dict[int, Local] = {}
        self.own_call: dict[int, Local] = {}
        self.top: Frame = Frame(None, None)
        self.top_this: Local


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
