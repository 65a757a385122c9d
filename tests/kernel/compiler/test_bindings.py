"""What the compiler keeps on nodes while it compiles: nothing is left, and two compilations do not meet."""

from __future__ import annotations

import ast as pyast
import copy
import pickle
from collections.abc import Callable

import pytest

from urbihw.kernel import errors
from urbihw.kernel.compiler import CompiledUnit, compile_node
from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.binding import UNBOUND, BoundNode
from urbihw.kernel.syntax.check import children
from urbihw.kernel.syntax.pace import STEPS_PER_PAUSE, StepPace
from urbihw.kernel.syntax.reader import Statement, parse_program

PROGRAM = (
    "{ var a = 1; for (var x : [1, 2]) { var b = x; detach({ a += b }); if (b > 1) break };"
    " at (e?(var y, [var z]) if y > a) { z; scopeTag.stop }; function f(var c = a) { call; this; c } }"
)


def node_of(text: str) -> ast.Node:
    (item,) = parse_program(text)
    assert isinstance(item, Statement)
    return item.node


def bound_nodes(node: ast.Node) -> list[ast.Node]:
    """The nodes that something is kept on."""
    found, todo = [], [node]
    while todo:
        each = todo.pop()
        if each.bound is not UNBOUND:
            found.append(each)
        todo.extend(children(each))
    return found


def python(unit: CompiledUnit) -> str:
    assert unit.tree is not None
    return pyast.unparse(unit.tree)


def paused(action: Callable[[], object]) -> StepPace:
    """A pace that does something at its first pause."""
    done: list[bool] = []

    def pause() -> None:
        if not done:
            done.append(True)
            action()

    return StepPace(pause)


def test_nothing_is_left_on_the_nodes() -> None:
    node = node_of(PROGRAM)
    compile_node(node)
    assert bound_nodes(node) == []


def test_nothing_is_left_when_it_is_given_up() -> None:
    node = node_of("{" + "f(1); " * STEPS_PER_PAUSE + "}")

    def give_up() -> None:
        assert bound_nodes(node)
        raise errors.StatementTooLong

    with pytest.raises(errors.StatementTooLong):
        compile_node(node, pace=StepPace(give_up))
    assert bound_nodes(node) == []


def test_nothing_is_left_when_it_is_too_deep() -> None:
    node = node_of("function () {" * 300 + "1" + "}" * 300)
    with pytest.raises(errors.TooDeep):
        compile_node(node)
    assert bound_nodes(node) == []


def test_two_jobs_may_compile_the_same_statement_at_once() -> None:
    node = node_of(PROGRAM)
    alone = python(compile_node(node, keep_tree=True))
    second: list[CompiledUnit] = []
    first = compile_node(node, pace=paused(lambda: second.append(compile_node(node, keep_tree=True))), keep_tree=True)
    assert [python(first), python(second[0])] == [alone, alone]


def test_a_part_of_a_statement_may_be_compiled_meanwhile() -> None:
    """As an argument that turned out to be lazy is."""
    node = node_of(PROGRAM)
    assert isinstance(node, ast.Scope)
    alone = python(compile_node(node, keep_tree=True))
    names = {"a": ("a_", False), "b": ("b_", False)}
    part = next(each for each in children(node) if isinstance(each, ast.Seq))
    first = compile_node(node, pace=paused(lambda: compile_node(part, late=names)), keep_tree=True)
    assert python(first) == alone


def test_a_copy_is_not_bound() -> None:
    node = node_of("f(x)")
    node.bound = BoundNode()  # type: ignore[misc]
    for other in (copy.deepcopy(node), pickle.loads(pickle.dumps(node))):
        assert other == node
        assert other.bound is UNBOUND
    assert "bound" not in repr(node)


def test_the_body_of_an_at_may_be_a_function_literal() -> None:
    """The literal's arguments are not what the handler receives."""
    unit = compile_node(node_of("at (x) function (a) { a }"), keep_tree=True)
    handler = [line.strip() for line in python(unit).splitlines() if line.strip().startswith("def ")][-2]
    assert handler.endswith("():")


def test_a_scope_has_one_tag() -> None:
    assert python(compile_node(node_of("{ scopeTag.stop }"), keep_tree=True)).count("scope_tag()") == 1
    assert python(compile_node(node_of("f(1) & { scopeTag.stop }"), keep_tree=True)).count("scope_tag()") == 1
