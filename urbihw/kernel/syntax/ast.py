"""Every node of a parsed urbiscript program: dataclasses of fields and a span, frozen for the type checker.

Spans are relative to the beginning of the top-level statement (its first character is 1.1), so that one parsed
statement can be reused wherever the same text is typed again.  Operators are calls: ``a + b`` is
``Call(a, "+", (b,))``, ``a[i]`` is ``Call(a, "[]", (i,))``, ``a[i] = v`` is ``Call(a, "[]=", (i, v))``,
``x in y`` is ``Call(y, "has", (x,))``; the printer shows them so, as the original did (``1.'+'(2)``).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, Final, TypeVar, dataclass_transform

from urbihw.kernel.syntax.binding import UNBOUND, BoundNode
from urbihw.kernel.syntax.location import NOWHERE, Span

T = TypeVar("T")
PLAIN: Final = frozenset(("str", "float", "bool", "Span", "BoundNode", "str | None", "float | None", "tuple[str, ...]"))
"""The types of fields that hold no nodes."""


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def node(*, kw_only: bool = False) -> Callable[[type[T]], type[T]]:
    """Make a class of nodes.

    The methods that dataclasses would generate for each class, comparison and all, would take a tenth of the start of
    the kernel; ``Node`` has them for all.
    """

    def make(kind: type[T]) -> type[T]:
        made = dataclass(slots=True, eq=False, repr=False, kw_only=kw_only)(kind)
        made.links = tuple(each.name for each in fields(made) if each.type not in PLAIN)  # type: ignore[arg-type, attr-defined]
        return made

    return make


@node(kw_only=True)
class Node:
    """Base of all nodes: the span that they cover, and what the compiler knows about them while it compiles.

    ``links`` are the names of the fields that hold nodes, or tuples with nodes among others.
    """

    links: ClassVar[tuple[str, ...]]
    span: Span = field(default=NOWHERE, compare=False)
    bound: BoundNode = field(default=UNBOUND, init=False, compare=False, repr=False)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Node) and self.__class__ is other.__class__ and self._content() == other._content()

    def __hash__(self) -> int:
        return hash((self.__class__, *self._content()))

    def __repr__(self) -> str:
        content = (f"{each.name}={getattr(self, each.name)!r}" for each in fields(self) if each.repr)
        return f"{self.__class__.__name__}({', '.join(content)})"

    def _content(self) -> list[Any]:
        return [getattr(self, each.name) for each in fields(self) if each.compare]


# ------------------------------------------------------------------ literals


@node()
class Float(Node):
    """A number, an angle in radians or a duration in seconds (units are already applied)."""

    value: float


@node()
class StringLiteral(Node):
    """A string literal, adjacent ones glued; one character per byte (latin-1)."""

    value: str


@node()
class ListLit(Node):
    """``[a, b]``; also a list pattern."""

    items: tuple[Node, ...]


@node()
class TupleLit(Node):
    """``()``, ``(a,)``, ``(a, b)``; also a tuple pattern."""

    items: tuple[Node, ...]


@node()
class DictLit(Node):
    """``["a" => 1]`` and ``[ => ]``; also a dictionary pattern."""

    pairs: tuple[tuple[Node, Node], ...]


# ------------------------------------------------------------------ names and messages


@node()
class This(Node):
    """``this``."""


@node()
class CallKeyword(Node):
    """``call``: the message by which the running function was called."""


@node()
class Call(Node):
    """``target.name(args)``; target None is a local variable or a slot of this; args None means no parentheses."""

    target: Node | None
    name: str
    args: tuple[Node, ...] | None = None


@node()
class And(Node):
    """``left && right``: the right side only if the left is true."""

    left: Node
    right: Node


@node()
class Or(Node):
    """``left || right``."""

    left: Node
    right: Node


@node()
class Property(Node):
    """``slot->name``; slot is a Call without arguments (a name, or ``target.name``)."""

    slot: Call
    name: str


# ------------------------------------------------------------------ declarations and assignments


@node()
class Var(Node):
    """``var name``, ``var target.name``, with an optional value; as a pattern, a binding (target and value None).

    ``function f() {...}`` is ``Var(None, "f", Function(...))``.  ``place`` is where the name stands (the target, if
    there is one): errors of the declaration point there.
    """

    target: Node | None
    name: str
    value: Node | None = None
    const: bool = False
    place: Span = field(default=NOWHERE, compare=False)


@node()
class Assign(Node):
    """``place = value modifiers``.

    ``place`` is a Call without arguments, a Property, or a pattern (ListLit, TupleLit, DictLit, or anything else
    that is matched).  ``modifiers`` are those of a trajectory: ``time: 1s`` is ("time", Float(1)).
    """

    place: Node
    value: Node
    modifiers: tuple[tuple[str, Node], ...] = ()


@node()
class OpAssign(Node):
    """``place op value`` where op is ``+=`` and so on; place is a Call (plain or ``[]``) or a Property."""

    place: Node
    op: str
    value: Node


@node()
class Postfix(Node):
    """``place++`` or ``place--``; the value is the former one."""

    place: Node
    op: str


# ------------------------------------------------------------------ functions and objects


@node()
class Formal(Node):
    """A formal argument: ``x``, ``var x``, ``x = default``, or ``var x[]`` which takes the rest as a list."""

    name: str
    default: Node | None = None
    variadic: bool = False


@node()
class Function(Node):
    """A function or closure literal; formals None means a lazy one."""

    closure: bool
    formals: tuple[Formal, ...] | None
    body: Scope


@node()
class External(Node):
    """``external kind (arity) path from source``: a remote UObject declares a part of itself.

    ``kind`` is object, var, function or event; ``path`` is ("X", "f") for ``X.f``; arity is None where the form has
    none, and so is source for ``external object X``.
    """

    kind: str
    path: tuple[str, ...]
    arity: float | None
    source: str | None


@node()
class Do(Node):
    """``do (target) { body }``; the value is the target."""

    target: Node
    body: Scope


@node()
class Class(Node):
    """``class target.name : protos { body }``; target None for a plain name."""

    target: Node | None
    name: str
    protos: tuple[Node, ...]
    body: Scope


# ------------------------------------------------------------------ composition of statements


@node()
class Empty(Node):
    """Nothing between two separators; its value is void.  Dropped from ``;`` lists, kept after ``|`` and ``&``."""


@node()
class Seq(Node):
    """Statements joined by ``;`` and ``,``: (statement, separator that follows it, or "" at the end).

    Empty statements between ``;`` are left out.
    """

    items: tuple[tuple[Node, str], ...]


@node()
class Pipe(Node):
    """``a | b | c``: no other job runs in between."""

    items: tuple[Node, ...]


@node()
class Par(Node):
    """``a & b & c``: all at once; the value is void."""

    items: tuple[Node, ...]


@node()
class Scope(Node):
    """``{ body }``; body None when empty."""

    body: Node | None


# ------------------------------------------------------------------ flow control


@node()
class If(Node):
    """``if (cond) then else otherwise``; cond may be any statement list, what it declares is seen in both branches."""

    cond: Node
    then: Node
    otherwise: Node | None


@node()
class While(Node):
    """``while flavor (cond) body``; flavor is ``;`` ``|`` or ``,``; ``loop body`` has cond None."""

    flavor: str
    cond: Node | None
    body: Node


@node()
class For(Node):
    """C-like ``for flavor (init; cond; step) body``; flavor is ``;`` ``|`` or ``,``."""

    flavor: str
    init: Node
    cond: Node
    step: Node
    body: Node


@node()
class ForEach(Node):
    """``for flavor (var name : items) body``, and ``for flavor (n) body`` with name None; flavor ``;`` ``|`` ``&``."""

    flavor: str
    name: str | None
    items: Node
    body: Node


@node()
class Break(Node):
    """``break``."""


@node()
class Continue(Node):
    """``continue``."""


@node()
class Return(Node):
    """``return value``; value None for void."""

    value: Node | None


@node()
class Case(Node):
    """One ``case pattern if guard: body``; pattern None is ``default``."""

    pattern: Node | None
    guard: Node | None
    body: Node | None


@node()
class Switch(Node):
    """``switch (value) { cases }``; a default, if any, is the last case."""

    value: Node
    cases: tuple[Case, ...]


@node()
class Catch(Node):
    """``catch (pattern if guard) body``; pattern None catches everything."""

    pattern: Node | None
    guard: Node | None
    body: Scope


@node()
class Try(Node):
    """``try body catches else otherwise finally final``."""

    body: Scope
    catches: tuple[Catch, ...]
    otherwise: Scope | None
    final: Scope | None


@node()
class Throw(Node):
    """``throw value``; value None rethrows inside a catch."""

    value: Node | None


@node()
class Assert(Node):
    """``assert(claim)`` and ``assert { claim; claim }``."""

    claims: tuple[Node, ...]


# ------------------------------------------------------------------ time, events, tags


@node()
class Tagged(Node):
    """``tag: body``."""

    tag: Node
    body: Node


@node()
class Emit(Node):
    """``event!``, ``event!(args)``, ``event!(args) ~ duration``; args None without parentheses."""

    event: Node
    args: tuple[Node, ...] | None
    duration: Node | None


@node()
class EventCond(Node):
    """``event?(patterns) if guard ~ duration``; patterns None accepts any payload, () only an empty one."""

    event: Node
    patterns: tuple[Node, ...] | None
    guard: Node | None
    duration: Node | None


@node()
class ExprCond(Node):
    """``expression ~ duration`` as the condition of at, whenever or waituntil."""

    expr: Node
    duration: Node | None


@node()
class At(Node):
    """``at (cond) body onleave leave``; with ``sync`` the job that makes the condition true waits for the bodies."""

    cond: EventCond | ExprCond
    body: Node
    leave: Node | None
    sync: bool = False


@node()
class Whenever(Node):
    """``whenever (cond) body else otherwise``."""

    cond: EventCond | ExprCond
    body: Node
    otherwise: Node | None


@node()
class WaitUntil(Node):
    """``waituntil (cond)``; variables of the pattern are declared in the enclosing scope."""

    cond: EventCond | ExprCond


@node()
class Every(Node):
    """``every flavor (period) body``; flavor is ``,`` (the default), ``|`` or ``;``."""

    flavor: str
    period: Node
    body: Node


@node()
class Guarded(Node):
    """``timeout (duration) body``, ``stopif (cond) body``, ``freezeif (cond) body``; kind is the keyword."""

    kind: str
    cond: EventCond | ExprCond | Node
    body: Node
