"""What the compiler learns about a node and stores on it while it compiles: variables, functions, jobs.

The slot ``bound`` of every node has ``UNBOUND`` outside of a compilation.  ``compiler.bind`` stores a ``BoundNode`` on
each node that needs one; when the code of the statement is written, all of them are removed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from urbihw.kernel import errors

MAX_FRAMES = 250
"""Maximum nesting depth of functions; the time that Python takes to compile them grows with its square."""


class Local:
    """One local variable of a function."""

    __slots__ = ("assigned", "captured", "const", "fresh", "frame", "late", "maybe_void", "name", "python")

    def __init__(self, name: str, python: str, frame: FunctionFrame, fresh: bool) -> None:
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
        """Whether the variable is stored in a Box."""
        return self.captured and self.assigned


class FunctionFrame:
    """One Python function that will be generated; ``literal`` if it is a function of the program, not a part that runs
    apart.

    ``this`` is the frame's own ``this``, None if it uses that of the enclosing frame.  ``call`` is the call message of
    a literal, ``params`` are the variables that the function receives, and ``scope_tag`` is the tag of its outermost
    scope if that is used.
    """

    __slots__ = (
        "call", "counter", "depth", "free", "literal", "loops", "params", "parent", "returns_through", "scope_tag",
        "this", "uses_call",
    )  # fmt: skip

    def __init__(self, parent: FunctionFrame | None, literal: bool = False) -> None:
        """Raises TooDeep if functions nest too deep."""
        self.parent = parent
        self.depth: int = 0 if parent is None else parent.depth + 1
        if self.depth > MAX_FRAMES:
            raise errors.TooDeep
        self.literal = literal
        self.free: dict[Local, None] = {}
        self.loops = 0
        self.counter: dict[str, int] = {} if parent is None else parent.counter
        self.uses_call = False
        self.returns_through = False
        self.this: Local | None = None
        self.call: Local | None = None
        self.params: list[Local] = []
        self.scope_tag: Local | None = None

    def unique(self, name: str) -> str:
        """A Python name for an urbiscript one, unique in the whole statement."""
        clean = name if name.isidentifier() and name.isascii() else _identifier(name)
        count = self.counter.get(clean, 0)
        self.counter[clean] = count + 1
        return f"{clean}_{count}" if count else f"{clean}_"


def _identifier(name: str) -> str:
    return "".join(c if c.isalnum() and c.isascii() else "_" for c in name)


Names = dict[str, tuple[str, bool]]
"""Urbiscript names of locals, their Python names, and whether they are stored in a Box."""


class Known(NamedTuple):
    """The locals that the arguments of a call name directly, and those that calls among them name."""

    own: Names
    inner: tuple[Known, ...]

    def all(self) -> Names:
        found: Names = {}
        todo = [self]
        while todo:
            each = todo.pop()
            found.update(each.own)
            todo.extend(each.inner)
        return found


class BoundNode:
    """What is known about one node of the statement that is being compiled."""

    __slots__ = (
        "apart", "detaches", "frame", "function", "known", "lazy", "local", "names", "piece", "scope_tag", "this",
    )  # fmt: skip

    def __init__(self) -> None:
        self.local: Local | None = None
        """The variable that the node names or declares; None for a slot."""
        self.this: Local | None = None
        """``this`` as the node sees it, if it needs it."""
        self.frame: FunctionFrame | None = None
        """The Python function whose body the node is."""
        self.function: FunctionFrame | None = None
        """The Python function that a function literal becomes."""
        self.names: list[Local | None] = []
        """What a pattern declares, in the order of the text; None for a slot of this."""
        self.scope_tag: Local | None = None
        """The tag of a scope, if it is used."""
        self.apart = False
        """Whether the node is a function of its own because it is too deep inside others."""
        self.detaches = False
        """Whether the body of a loop starts jobs that run on independently, under the tags of the job that
        started them."""
        self.piece: str | None = None
        """The variable that stores the value of an operation in a very long sum, empty if another operation's variable
        does."""
        self.lazy = False
        """Whether the arguments of a call or a choice are functions, since its name may mean a lazy function."""
        self.known: Known | None = None
        """The locals that the arguments of a call name."""

    def __reduce__(self) -> tuple[Callable[[], BoundNode], tuple[()]]:
        """Copies of nodes and nodes loaded from the disk are not bound."""
        return _unbound, ()


def _unbound() -> BoundNode:
    return UNBOUND


UNBOUND = BoundNode()
"""The ``BoundNode`` of all unbound nodes; it is never modified."""
