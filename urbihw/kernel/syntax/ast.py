"""Every node of a parsed urbiscript program: frozen dataclasses of fields and a span.

Spans are relative to the beginning of the top-level statement (its first character is 1.1), so that one parsed
statement can be reused wherever the same text is typed again.  Operators are calls: ``a + b`` is
``Call(a, "+", (b,))``, ``a[i]`` is ``Call(a, "[]", (i,))``, ``a[i] = v`` is ``Call(a, "[]=", (i, v))``,
``x in y`` is ``Call(y, "has", (x,))``; the printer shows them so, as the original did (``1.'+'(2)``).
"""

from __future__ import annotations

from dataclasses import dataclass, field

from urbihw.kernel.syntax.location import NOWHERE, Span


@dataclass(frozen=True, slots=True, kw_only=True)
class Node:
    """What all nodes have: the span they cover."""

    span: Span = field(default=NOWHERE, compare=False)


# ------------------------------------------------------------------ literals


@dataclass(frozen=True, slots=True)
class Float(Node):
    """A number, an angle in radians or a duration in seconds (units are already applied)."""

    value: float


@dataclass(frozen=True, slots=True)
class String(Node):
    """A string literal, adjacent ones glued; one character per byte (latin-1)."""

    value: str


@dataclass(frozen=True, slots=True)
class ListLit(Node):
    """``[a, b]``; also a list pattern."""

    items: tuple[Node, ...]


@dataclass(frozen=True, slots=True)
class TupleLit(Node):
    """``()``, ``(a,)``, ``(a, b)``; also a tuple pattern."""

    items: tuple[Node, ...]


@dataclass(frozen=True, slots=True)
class DictLit(Node):
    """``["a" => 1]`` and ``[ => ]``; also a dictionary pattern."""

    pairs: tuple[tuple[Node, Node], ...]


# ------------------------------------------------------------------ names and messages


@dataclass(frozen=True, slots=True)
class This(Node):
    """``this``."""


@dataclass(frozen=True, slots=True)
class CallMessage(Node):
    """``call``: the message by which the running function was called."""


@dataclass(frozen=True, slots=True)
class Call(Node):
    """``target.name(args)``; target None is a local variable or a slot of this; args None means no parentheses."""

    target: Node | None
    name: str
    args: tuple[Node, ...] | None = None


@dataclass(frozen=True, slots=True)
class And(Node):
    """``left && right``: the right side only if the left is true."""

    left: Node
    right: Node


@dataclass(frozen=True, slots=True)
class Or(Node):
    """``left || right``."""

    left: Node
    right: Node


@dataclass(frozen=True, slots=True)
class Property(Node):
    """``slot->name``; slot is a Call without arguments (a name, or ``target.name``)."""

    slot: Call
    name: str


# ------------------------------------------------------------------ declarations and assignments


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True)
class Assign(Node):
    """``place = value modifiers``.

    ``place`` is a Call without arguments, a Property, or a pattern (ListLit, TupleLit, DictLit, or anything else
    that is matched).  ``modifiers`` are those of a trajectory: ``time: 1s`` is ("time", Float(1)).
    """

    place: Node
    value: Node
    modifiers: tuple[tuple[str, Node], ...] = ()


@dataclass(frozen=True, slots=True)
class OpAssign(Node):
    """``place op value`` where op is ``+=`` and so on; place is a Call (plain or ``[]``) or a Property."""

    place: Node
    op: str
    value: Node


@dataclass(frozen=True, slots=True)
class Postfix(Node):
    """``place++`` or ``place--``; the value is the former one."""

    place: Node
    op: str


# ------------------------------------------------------------------ functions and objects


@dataclass(frozen=True, slots=True)
class Formal(Node):
    """A formal argument: ``x``, ``var x``, ``x = default``, or ``var x[]`` which takes the rest as a list."""

    name: str
    default: Node | None = None
    variadic: bool = False


@dataclass(frozen=True, slots=True)
class Function(Node):
    """A function or closure literal; formals None means a lazy one."""

    closure: bool
    formals: tuple[Formal, ...] | None
    body: Scope


@dataclass(frozen=True, slots=True)
class External(Node):
    """``external kind (arity) path from source``: a remote UObject declares a part of itself.

    ``kind`` is object, var, function or event; ``path`` is ("X", "f") for ``X.f``; arity is None where the form has
    none, and so is source for ``external object X``.
    """

    kind: str
    path: tuple[str, ...]
    arity: float | None
    source: str | None


@dataclass(frozen=True, slots=True)
class Do(Node):
    """``do (target) { body }``; the value is the target."""

    target: Node
    body: Scope


@dataclass(frozen=True, slots=True)
class Class(Node):
    """``class target.name : protos { body }``; target None for a plain name."""

    target: Node | None
    name: str
    protos: tuple[Node, ...]
    body: Scope


# ------------------------------------------------------------------ composition of statements


@dataclass(frozen=True, slots=True)
class Empty(Node):
    """Nothing between two separators; its value is void.  Dropped from ``;`` lists, kept after ``|`` and ``&``."""


@dataclass(frozen=True, slots=True)
class Seq(Node):
    """Statements joined by ``;`` and ``,``: (statement, separator that follows it, or "" at the end).

    Empty statements between ``;`` are left out.
    """

    items: tuple[tuple[Node, str], ...]


@dataclass(frozen=True, slots=True)
class Pipe(Node):
    """``a | b | c``: no other job runs in between."""

    items: tuple[Node, ...]


@dataclass(frozen=True, slots=True)
class Par(Node):
    """``a & b & c``: all at once; the value is void."""

    items: tuple[Node, ...]


@dataclass(frozen=True, slots=True)
class Scope(Node):
    """``{ body }``; body None when empty."""

    body: Node | None


# ------------------------------------------------------------------ flow control


@dataclass(frozen=True, slots=True)
class If(Node):
    """``if (cond) then else otherwise``; cond may be any statement list, what it declares is seen in both branches."""

    cond: Node
    then: Node
    otherwise: Node | None


@dataclass(frozen=True, slots=True)
class While(Node):
    """``while flavor (cond) body``; flavor is ``;`` ``|`` or ``,``; ``loop body`` has cond None."""

    flavor: str
    cond: Node | None
    body: Node


@dataclass(frozen=True, slots=True)
class For(Node):
    """C-like ``for flavor (init; cond; step) body``; flavor is ``;`` ``|`` or ``,``."""

    flavor: str
    init: Node
    cond: Node
    step: Node
    body: Node


@dataclass(frozen=True, slots=True)
class ForEach(Node):
    """``for flavor (var name : items) body``, and ``for flavor (n) body`` with name None; flavor ``;`` ``|`` ``&``."""

    flavor: str
    name: str | None
    items: Node
    body: Node


@dataclass(frozen=True, slots=True)
class Break(Node):
    """``break``."""


@dataclass(frozen=True, slots=True)
class Continue(Node):
    """``continue``."""


@dataclass(frozen=True, slots=True)
class Return(Node):
    """``return value``; value None for void."""

    value: Node | None


@dataclass(frozen=True, slots=True)
class Case(Node):
    """One ``case pattern if guard: body``; pattern None is ``default``."""

    pattern: Node | None
    guard: Node | None
    body: Node | None


@dataclass(frozen=True, slots=True)
class Switch(Node):
    """``switch (value) { cases }``; a default, if any, is the last case."""

    value: Node
    cases: tuple[Case, ...]


@dataclass(frozen=True, slots=True)
class Catch(Node):
    """``catch (pattern if guard) body``; pattern None catches everything."""

    pattern: Node | None
    guard: Node | None
    body: Scope


@dataclass(frozen=True, slots=True)
class Try(Node):
    """``try body catches else otherwise finally final``."""

    body: Scope
    catches: tuple[Catch, ...]
    otherwise: Scope | None
    final: Scope | None


@dataclass(frozen=True, slots=True)
class Throw(Node):
    """``throw value``; value None rethrows inside a catch."""

    value: Node | None


@dataclass(frozen=True, slots=True)
class Assert(Node):
    """``assert(claim)`` and ``assert { claim; claim }``."""

    claims: tuple[Node, ...]


# ------------------------------------------------------------------ time, events, tags


@dataclass(frozen=True, slots=True)
class Tagged(Node):
    """``tag: body``."""

    tag: Node
    body: Node


@dataclass(frozen=True, slots=True)
class Emit(Node):
    """``event!``, ``event!(args)``, ``event!(args) ~ duration``; args None without parentheses."""

    event: Node
    args: tuple[Node, ...] | None
    duration: Node | None


@dataclass(frozen=True, slots=True)
class EventCond(Node):
    """``event?(patterns) if guard ~ duration``; patterns None accepts any payload, () only an empty one."""

    event: Node
    patterns: tuple[Node, ...] | None
    guard: Node | None
    duration: Node | None


@dataclass(frozen=True, slots=True)
class ExprCond(Node):
    """``expression ~ duration`` as the condition of at, whenever or waituntil."""

    expr: Node
    duration: Node | None


@dataclass(frozen=True, slots=True)
class At(Node):
    """``at (cond) body onleave leave``."""

    cond: EventCond | ExprCond
    body: Node
    leave: Node | None


@dataclass(frozen=True, slots=True)
class Whenever(Node):
    """``whenever (cond) body else otherwise``."""

    cond: EventCond | ExprCond
    body: Node
    otherwise: Node | None


@dataclass(frozen=True, slots=True)
class WaitUntil(Node):
    """``waituntil (cond)``; variables of the pattern are declared in the enclosing scope."""

    cond: EventCond | ExprCond


@dataclass(frozen=True, slots=True)
class Every(Node):
    """``every flavor (period) body``; flavor is ``,`` (the default), ``|`` or ``;``."""

    flavor: str
    period: Node
    body: Node


@dataclass(frozen=True, slots=True)
class Guarded(Node):
    """``timeout (duration) body``, ``stopif (cond) body``, ``freezeif (cond) body``; kind is the keyword."""

    kind: str
    cond: EventCond | ExprCond | Node
    body: Node
