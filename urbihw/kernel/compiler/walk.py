"""The walk over a statement on which ``bind`` is built: names, scopes, frames, loops and blocks."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

from urbihw.kernel import errors
from urbihw.kernel.compiler.scopes import Binding, Frame, Local, Scope, binding_names
from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.check import children
from urbihw.kernel.syntax.pace import Pace

BLOCKS: Final[dict[type[ast.Node], int]] = {
    **dict.fromkeys((ast.While, ast.For, ast.ForEach, ast.Every), 5),
    ast.Try: 3,
    **dict.fromkeys((ast.Tagged, ast.Guarded, ast.Scope), 2),
    ast.Par: 1,
}
"""How many of Python's blocks (loops, ``try``, ``with``) each of ours is at the most."""
SCOPED: Final = (
    ast.Scope, ast.Function, ast.While, ast.For, ast.ForEach, ast.Every, ast.If, ast.Switch, ast.Catch, ast.At,
    ast.Whenever, ast.Do,
)  # fmt: skip
"""What keeps the variables declared in it to itself."""
MOST_BLOCKS = 18
"""Python nests 20 of them in a function; the function itself may need two."""
MOST_CAPTURES = 200_000
"""How many variables the functions of a statement may capture, each counted in each function that it goes through."""


class Walker:
    """One walk over the statement; a method ``_Node`` per node with scoping rules of its own."""

    def __init__(self, lazy_names: Iterable[str], apart: bool, pace: Pace) -> None:
        """``apart``: loops, tags and ``try`` deep inside others become functions of their own."""
        self.apart = apart
        self.pace = pace
        self.captures = 0
        self.blocks = 0
        self.bodies: list[int] = []
        self.result = Binding()
        self.result.lazy_names = set(lazy_names)
        self.frame = self.result.top
        self.scope = Scope(None, self.frame, slots=True, block=True)
        self.this = self.result.top_this = self.declare("this")

    # ---------------------------------------------------------------- names

    def declare(self, name: str) -> Local:
        """A new local in the present scope."""
        local = Local(name, self.frame.unique(name), self.frame, self.frame.loops > 0)
        self.scope.names[name] = local
        return local

    def lookup(self, name: str) -> Local | None:
        """The local that a name means here, or None for a slot; notes who captures it."""
        scope: Scope | None = self.scope
        while scope is not None:
            local = scope.names.get(name)
            if local is not None:
                self.use(local)
                return local
            scope = scope.outer
        return None

    def use(self, local: Local) -> None:
        """The present frame reads or writes a local."""
        if local.late:
            return
        frame: Frame | None = self.frame
        while frame is not None and frame is not local.frame:
            local.captured = True
            if local not in frame.free:
                self.captures += 1
                if self.captures > MOST_CAPTURES:
                    raise errors.TooLong
                frame.free[local] = None
            frame = frame.parent

    def use_this(self, node: ast.Node) -> None:
        """The node needs ``this``."""
        self.use(self.this)
        self.result.this[id(node)] = self.this

    # ---------------------------------------------------------------- walking

    def walk(self, node: Any) -> None:
        """Visit a node, or each node of a tuple; None is nothing."""
        if node is None:
            return
        if isinstance(node, tuple):
            for member in node:
                self.walk(member)
            return
        if not isinstance(node, ast.Node):
            return
        weight = BLOCKS.get(type(node)) if self.apart else None
        if weight is None:
            self.visit(node)
        else:
            self.block(node, weight)

    def visit(self, node: ast.Node) -> None:
        """Visit a node by its own method."""
        self.pace.step()
        method = getattr(self, "_" + type(node).__name__, None)
        if method is not None:
            method(node)
        else:
            self.children(node)

    def block(self, node: ast.Node, weight: int) -> None:
        """Visit what Python can nest only so deep in one function."""
        if self.blocks + weight > MOST_BLOCKS and not _declares(node, self.pace):
            self.result.apart.add(id(node))
            self.framed(node)
            return
        self.blocks += weight
        self.visit(node)
        self.blocks -= weight

    def children(self, node: ast.Node) -> None:
        """Visit all fields in order."""
        for name in type(node).__dataclass_fields__:
            if name != "span":
                self.walk(getattr(node, name))

    def scoped(self, *nodes: Any) -> None:
        """Visit nodes in a scope of their own."""
        self.scope = Scope(self.scope, self.frame, slots=False)
        try:
            for node in nodes:
                self.walk(node)
        finally:
            assert self.scope.outer is not None
            self.scope = self.scope.outer

    def framed(self, node: ast.Node, bound: tuple[ast.Node, ...] = ()) -> Frame:
        """Visit a node as the body of a Python function of its own; ``bound`` are patterns whose names it receives."""
        frame = Frame(self.frame, None)
        self.result.frames[id(node)] = frame
        outer_frame, outer_scope, outer_blocks = self.frame, self.scope, self.blocks
        self.frame, self.blocks = frame, 0
        self.scope = Scope(outer_scope, frame, outer_scope.slots and not bound, block=True)
        try:
            if bound:
                self.result.formals[id(node)] = [self.declare(name) for name in binding_names(bound)]
            self.walk(node)
            self.keep_scope_tag(node)
        finally:
            self.frame, self.scope, self.blocks = outer_frame, outer_scope, outer_blocks
        return frame

    def keep_scope_tag(self, node: ast.Node) -> None:
        """Remember the scope tag that was wanted in the present scope, which is that of a node."""
        local = self.scope.names.get(" scope tag")
        if local is not None:
            self.result.scope_tags[id(node)] = local

    def loop(self, head: ast.Node | None, body: ast.Node, apart: bool) -> None:
        """Visit a loop; ``apart`` when each turn of the body is a job of its own."""
        self.frame.loops += 1
        self.bodies.append(id(body))
        self.scope = Scope(self.scope, self.frame, slots=False)
        self.walk(head)
        if apart:
            self.framed(body)
        else:
            self.walk(body)
        self.bodies.pop()
        assert self.scope.outer is not None
        self.scope = self.scope.outer
        self.frame.loops -= 1


def _declares(node: ast.Node, pace: Pace) -> bool:
    """Whether a node declares variables of the scope around it."""
    todo = [node]
    while todo:
        pace.step()
        each = todo.pop()
        if isinstance(each, ast.Var | ast.Class):
            return True
        if not isinstance(each, SCOPED):
            todo.extend(children(each))
    return False
