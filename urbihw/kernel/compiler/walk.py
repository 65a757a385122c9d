"""The ``Binder``: walks over a statement and keeps track of names, scopes, frames, loops and blocks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final

from urbihw.kernel import errors
from urbihw.kernel.compiler.scopes import Binding, NameScope, binding_names
from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.binding import FunctionFrame, Local
from urbihw.kernel.syntax.check import children
from urbihw.kernel.syntax.pace import StepPace

BLOCKS: Final[dict[type[ast.Node], int]] = {
    **dict.fromkeys((ast.While, ast.For, ast.ForEach, ast.Every), 5),
    ast.Try: 4,
    **dict.fromkeys((ast.Tagged, ast.Guarded, ast.Scope), 2),
    ast.Par: 1,
}
"""Maximum number of Python blocks (loops, ``try``, ``with``) for each kind of node."""
SCOPED: Final = (
    ast.Scope, ast.Function, ast.While, ast.For, ast.ForEach, ast.Every, ast.If, ast.Switch, ast.Catch, ast.At,
    ast.Whenever, ast.Do,
)  # fmt: skip
"""The nodes that limit the scope of variables declared in them."""
MAX_BLOCKS = 18
"""Python nests 20 of them in a function; the function itself may need two."""
MAX_CAPTURES = 200_000
"""Maximum number of variables that the functions of a statement may capture, counted in each function that passes them
on."""
SCOPE_TAG: Final = " scope tag"
"""The name under which a scope has its tag; no program can write it."""

Visitors = Mapping[type[ast.Node], Callable[[Any, "Binder"], None]]
"""The visitors of the classes of nodes with special scoping rules; all other nodes are only walked over."""


class Binder:
    """The state of a walk over one statement: the frame, the scope, ``this`` and the loops that a node is in."""

    def __init__(self, visitors: Visitors, lazy_names: Iterable[str], apart: bool, pace: StepPace) -> None:
        """``apart``: loops, tags and ``try`` deep inside others become functions of their own."""
        self.visitors = visitors
        self.apart = apart
        self.pace = pace
        self.captures = 0
        self.blocks = 0
        self.bodies: list[ast.Node] = []
        self.result = Binding(lazy_names)
        self.bound = self.result.bound
        self.frame = self.result.top
        self.scope = NameScope(None, self.frame, slots=True, block=True)
        self.this = self.frame.this = self.declare("this")

    # ---------------------------------------------------------------- names

    def declare(self, name: str) -> Local:
        """A new local in the present scope."""
        local = Local(name, self.frame.unique(name), self.frame, self.frame.loops > 0)
        self.scope.names[name] = local
        return local

    def declare_all(self, names: list[str], node: ast.Node) -> None:
        """Declare the names of a pattern, which the node is or has; slots of ``this`` where ``var`` makes such."""
        bound = self.bound(node)
        if not self.scope.slots:
            bound.names = [self.declare(name) for name in names]
        elif names:
            self.use_this(node)
            bound.names = [None] * len(names)

    def lookup(self, name: str) -> Local | None:
        """The local variable that a name means here, or None for a slot; records capturing functions."""
        scope: NameScope | None = self.scope
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
        frame: FunctionFrame | None = self.frame
        while frame is not None and frame is not local.frame:
            local.captured = True
            if local not in frame.free:
                self.captures += 1
                if self.captures > MAX_CAPTURES:
                    raise errors.StatementTooLong
                frame.free[local] = None
            frame = frame.parent

    def use_this(self, node: ast.Node) -> None:
        """The node needs ``this``."""
        self.use(self.this)
        self.bound(node).this = self.this

    def function_around(self) -> FunctionFrame | None:
        """The frame of the innermost function literal."""
        frame: FunctionFrame | None = self.frame
        while frame is not None and not frame.literal:
            frame = frame.parent
        return frame

    # ---------------------------------------------------------------- walking

    def walk(self, node: ast.Node | None) -> None:
        """Visit a node, if there is one."""
        if node is None:
            return
        if self.apart:
            weight = BLOCKS.get(node.__class__)
            if weight is not None:
                self.block(node, weight)
                return
        self.visit(node)

    def walk_all(self, nodes: Iterable[Any] | None) -> None:
        """Visit each node of a tuple, and of the tuples in it."""
        for node in nodes or ():
            if node.__class__ is tuple:
                self.walk_all(node)
            elif isinstance(node, ast.Node):
                self.walk(node)

    def visit(self, node: ast.Node) -> None:
        """Visit a node by the visitor of its class, or all nodes in it in the order of its fields."""
        self.pace.step()
        visitor = self.visitors.get(node.__class__)
        if visitor is not None:
            visitor(node, self)
            return
        for name in node.links:
            value = getattr(node, name)
            if value.__class__ is tuple:
                self.walk_all(value)
            else:
                self.walk(value)

    def block(self, node: ast.Node, weight: int) -> None:
        """Visit a node that uses some of the blocks that Python can nest in one function."""
        if self.blocks + weight > MAX_BLOCKS and not _declares(node, self.pace):
            self.bound(node).apart = True
            self.framed(node)
            return
        self.blocks += weight
        self.visit(node)
        self.blocks -= weight

    # ---------------------------------------------------------------- scopes, functions, loops

    def enter_scope(self) -> None:
        """Begin a scope, which ends with ``leave_scope``."""
        self.scope = NameScope(self.scope, self.frame, slots=False)

    def leave_scope(self) -> None:
        """The present scope ends."""
        assert self.scope.outer is not None
        self.scope = self.scope.outer

    def scoped(self, node: ast.Node | None) -> None:
        """Visit a node in a scope of its own."""
        self.enter_scope()
        self.walk(node)
        self.leave_scope()

    def framed(self, node: ast.Node, patterns: tuple[ast.Node, ...] = ()) -> FunctionFrame:
        """Visit a node as the body of a Python function of its own, which receives what the patterns bind."""
        frame = self.bound(node).frame = FunctionFrame(self.frame)
        outer_frame, outer_scope, outer_blocks = self.frame, self.scope, self.blocks
        self.frame, self.blocks = frame, 0
        self.scope = NameScope(outer_scope, frame, outer_scope.slots and not patterns, block=True)
        if patterns:
            frame.params = [self.declare(name) for name in binding_names(patterns)]
        self.walk(node)
        frame.scope_tag = self.scope.names.get(SCOPE_TAG)
        self.frame, self.scope, self.blocks = outer_frame, outer_scope, outer_blocks
        return frame

    def enter_turn(self, body: ast.Node) -> None:
        """Begin the part of a loop that runs in each iteration."""
        self.frame.loops += 1
        self.bodies.append(body)

    def leave_turn(self) -> None:
        """The innermost loop ends."""
        self.frame.loops -= 1
        self.bodies.pop()


def _declares(node: ast.Node, pace: StepPace) -> bool:
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
