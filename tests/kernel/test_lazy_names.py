"""What a lazy function of one connection must not do: make calls of the same name slow for everybody."""

from __future__ import annotations

from urbihw.kernel import Kernel
from urbihw.kernel.compiler import compile_node
from urbihw.kernel.runtime.slots import STRICT_NAMES
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.syntax.reader import Statement, parse_program


def code_size(text: str, lazy_names: set[str]) -> int:
    """Bytes of the code of a statement and of the functions in it."""
    (statement,) = parse_program(text)
    assert isinstance(statement, Statement)
    todo, size = [compile_node(statement.node, lazy_names).code], 0
    while todo:
        code = todo.pop()
        size += len(code.co_code)
        todo += [each for each in code.co_consts if hasattr(each, "co_code")]
    return size


def test_names_that_everybody_uses_stay_strict() -> None:
    kernel = Kernel(SimClock())
    lobby = kernel.open_lobby()
    assert not STRICT_NAMES & kernel.host.world.lazy_names
    made = "class K {}|; K.setSlot(\"new\", function { call.args.size })|; "
    text = made + "K.new(1 / 0, x); function f { K.new(undefined) }|; f;"
    assert kernel.run_text(lobby, text) == "[00000000] 2\n[00000000] 1\n"
    assert not STRICT_NAMES & kernel.host.world.lazy_names


def test_a_strict_function_gets_values_although_its_name_is_lazy() -> None:
    kernel = Kernel(SimClock())
    first, second = kernel.open_lobby(), kernel.open_lobby()
    assert kernel.run_text(first, "function add { call.args.size }|; add(undefined);") == "[00000000] 1\n"
    text = """
        class A { function add(x, y) { x + y } }|; var a = A.new|;
        { var k = 3; var f = 0; for (2) { f = k; k = a.add(f, k + 1) }; k };
        a.add(a.add(1, a.add(2, 3)), [4, 5][1]);
        function g() { var add = function(x) { x * 2 }; add(21) }|; g;
        a.add;
        a.add(1, void);
        """
    assert kernel.run_text(second, text).splitlines() == [
        "[00000000] 15",
        "[00000000] 11",
        "[00000000] 42",
        "[00000000:error] !!! 6.9-13: add: expected 2 arguments, given 0",
        "[00000000:error] !!! 7.9-22: unexpected void",
    ]


def test_calls_inside_calls_are_not_written_twice_at_each_level() -> None:
    text = "1"
    for _ in range(12):
        text = f"o.add({text})"
    assert code_size(text, {"add"}) < 12 * code_size("o.add(o.add(1))", {"add"})
