"""What is a syntax error although the grammar accepts it: words out of place, and names declared twice.

``check`` walks a statement with the circumstances of each node: whether it is in a loop, a function or a catch, and
the names declared so far in its scope.  It keeps its own stack, since programs may nest deeper than Python calls.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.ast import Node
from urbihw.kernel.syntax.pace import Pace
from urbihw.kernel.syntax.rules import Problem


@dataclass(frozen=True, slots=True)
class _Around:
    """The circumstances of a node; ``names`` is None where ``var`` makes slots instead of local variables."""

    loop: bool = False
    function: bool = False
    call: bool = False
    catch: bool = False
    names: set[str] | None = None

    def scope(self) -> _Around:
        return replace(self, names=set())


# A statement without any of these words has nothing to check.
CHECKED = frozenset(
    ["break", "call", "catch", "class", "closure", "const", "continue", "enum", "function", "return", "throw", "var"]
)

_Step = tuple[Node, _Around]
_TOP = _Around()


def check(statement: Node, pace: Pace) -> list[Problem]:
    """The errors of a whole statement, in the order of the text; each node is two steps."""
    problems: list[Problem] = []
    todo: list[_Step] = [(statement, _TOP)]
    while todo:
        pace.step()
        node, around = todo.pop()
        message = _complaint(node, around)
        if message is not None:
            problems.append(Problem(message, node.span))
        if isinstance(node, ast.Try):
            problems.extend(_unreachable(node))
        steps = []
        for step in _steps(node, around):
            pace.step()
            steps.append(step)
        steps.reverse()
        todo += steps
    return problems


def children(node: Node) -> Iterator[Node]:
    """The nodes directly below a node, in the order of its fields."""
    for name in node.links:
        value = getattr(node, name)
        if isinstance(value, Node):
            yield value
        elif type(value) is tuple:
            yield from _nodes_in(value)


def _nodes_in(items: tuple[object, ...]) -> Iterator[Node]:
    for item in items:
        if isinstance(item, Node):
            yield item
        elif type(item) is tuple:
            yield from _nodes_in(item)


def _complaint(node: Node, around: _Around) -> str | None:
    """What is wrong with the node itself where it stands."""
    match node:
        case ast.Break() if not around.loop:
            return "`break' not within a loop"
        case ast.Continue() if not around.loop:
            return "`continue' not within a loop"
        case ast.Return() if not around.function:
            return "return: outside a function"
        case ast.CallMessage() if not around.call:
            return "call: used outside any function"
        case ast.Throw(value=None) if not around.catch:
            return "throw: argumentless throw outside of a catch block"
        case ast.Var(target=None, name=name) | ast.Class(target=None, name=name) if around.names is not None:
            if name in around.names:
                return f"variable redefinition: {name}"
            around.names.add(name)
        case ast.Formal(name=name) if around.names is not None:
            if name in around.names:
                return f"variable redefinition: {name}"
            around.names.add(name)
    return None


def _unreachable(node: ast.Try) -> Iterator[Problem]:
    """The catch clauses behind one that catches everything."""
    caught = False
    for clause in node.catches:
        if caught:
            yield Problem("catch: exception already caught by a previous clause", clause.span)
        caught = caught or clause.pattern is None


def _steps(node: Node, around: _Around) -> Iterator[_Step]:
    """The nodes directly below a node, each with its circumstances."""
    match node:
        case ast.Scope():
            if node.body is not None:
                yield node.body, around.scope()
        case ast.Function():
            yield from _function_steps(node, around)
        case ast.Do() | ast.Class():
            slots = replace(around, names=None)
            yield from ((child, around) for child in children(node) if child is not node.body)
            if node.body.body is not None:
                yield node.body.body, slots
        case ast.While() | ast.For() | ast.ForEach() | ast.Every():
            head = around.scope()
            yield from ((child, head) for child in children(node) if child is not node.body)
            yield node.body, replace(head.scope(), loop=True)
        case ast.At() | ast.Whenever():
            # The bodies are run later, as jobs of their own: no loop around the statement is theirs.
            apart = replace(around, loop=False)
            yield from ((child, apart.scope()) for child in children(node))
        case ast.Catch():
            inside = replace(around.scope(), catch=True)
            yield from ((child, inside) for child in children(node))
        case ast.If() | ast.Case() | ast.WaitUntil():
            yield from ((child, around.scope()) for child in children(node))
        case ast.Assign():
            # Binding a pattern again is left to the run time, like assigning again.
            yield node.place, around.scope()
            yield node.value, around
            yield from ((value, around) for _, value in node.modifiers)
        case _:
            yield from ((child, around) for child in children(node))


def _function_steps(node: ast.Function, around: _Around) -> Iterator[_Step]:
    """A closure has the call message of the function around it, a function has its own."""
    inside = _Around(function=True, call=around.call or not node.closure, names=set())
    yield from ((formal, inside) for formal in node.formals or ())
    if node.body.body is not None:
        # The body may hide an argument by a variable of the same name.
        yield node.body.body, inside.scope()
