"""Syntax errors that the grammar does not detect: words out of place, and names declared twice.

``check`` walks a statement with the context of each node: whether it is in a loop, a function or a catch, and the names
declared so far in its scope.  It has its own stack, since programs may nest deeper than Python calls.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from urbihw.frozen import frozen
from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.ast import Node
from urbihw.kernel.syntax.pace import StepPace
from urbihw.kernel.syntax.rules import Problem


@frozen
class _Context:
    """The context of a node; ``names`` is None where ``var`` declares slots instead of local variables."""

    loop: bool = False
    function: bool = False
    call: bool = False
    catch: bool = False
    names: set[str] | None = None

    def scope(self) -> _Context:
        return replace(self, names=set())


# A statement without any of these words has nothing to check.
CHECKED = frozenset(
    ["break", "call", "catch", "class", "closure", "const", "continue", "enum", "function", "return", "throw", "var"]
)

_Step = tuple[Node, _Context]
_TOP = _Context()


def check(statement: Node, pace: StepPace) -> list[Problem]:
    """The errors of a whole statement, in the order of the text; each node is two steps."""
    problems: list[Problem] = []
    todo: list[_Step] = [(statement, _TOP)]
    while todo:
        pace.step()
        node, context = todo.pop()
        message = _complaint(node, context)
        if message is not None:
            problems.append(Problem(message, node.span))
        if isinstance(node, ast.Try):
            problems.extend(_unreachable(node))
        steps = []
        for step in _steps(node, context):
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


def _complaint(node: Node, context: _Context) -> str | None:
    """The error of the node itself in its context; None if there is none."""
    match node:
        case ast.Break() if not context.loop:
            return "`break' not within a loop"
        case ast.Continue() if not context.loop:
            return "`continue' not within a loop"
        case ast.Return() if not context.function:
            return "return: outside a function"
        case ast.CallKeyword() if not context.call:
            return "call: used outside any function"
        case ast.Throw(value=None) if not context.catch:
            return "throw: argumentless throw outside of a catch block"
        case ast.Var(target=None, name=name) | ast.Class(target=None, name=name) if context.names is not None:
            if name in context.names:
                return f"variable redefinition: {name}"
            context.names.add(name)
        case ast.Formal(name=name) if context.names is not None:
            if name in context.names:
                return f"variable redefinition: {name}"
            context.names.add(name)
    return None


def _unreachable(node: ast.Try) -> Iterator[Problem]:
    """The catch clauses behind one that catches everything."""
    caught = False
    for clause in node.catches:
        if caught:
            yield Problem("catch: exception already caught by a previous clause", clause.span)
        caught = caught or clause.pattern is None


def _steps(node: Node, context: _Context) -> Iterator[_Step]:
    """The nodes directly below a node, each with its context."""
    match node:
        case ast.Scope():
            if node.body is not None:
                yield node.body, context.scope()
        case ast.Function():
            yield from _function_steps(node, context)
        case ast.Do() | ast.Class():
            slots = replace(context, names=None)
            yield from ((child, context) for child in children(node) if child is not node.body)
            if node.body.body is not None:
                yield node.body.body, slots
        case ast.While() | ast.For() | ast.ForEach() | ast.Every():
            head = context.scope()
            yield from ((child, head) for child in children(node) if child is not node.body)
            yield node.body, replace(head.scope(), loop=True)
        case ast.At() | ast.Whenever():
            # The bodies run later, as jobs of their own: they are not inside a loop around the statement.
            apart = replace(context, loop=False)
            yield from ((child, apart.scope()) for child in children(node))
        case ast.Catch():
            inside = replace(context.scope(), catch=True)
            yield from ((child, inside) for child in children(node))
        case ast.If() | ast.Case() | ast.WaitUntil():
            yield from ((child, context.scope()) for child in children(node))
        case ast.Assign():
            # To bind a pattern again is a matter of the run time, as to assign again is.
            yield node.place, context.scope()
            yield node.value, context
            yield from ((value, context) for _, value in node.modifiers)
        case _:
            yield from ((child, context) for child in children(node))


def _function_steps(node: ast.Function, context: _Context) -> Iterator[_Step]:
    """A closure has the call message of the function around it, a function has its own."""
    inside = _Context(function=True, call=context.call or not node.closure, names=set())
    yield from ((formal, inside) for formal in node.formals or ())
    if node.body.body is not None:
        # The body may hide an argument with a variable of the same name.
        yield node.body.body, inside.scope()
