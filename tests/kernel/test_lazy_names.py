"""What a lazy function of one connection must not do: make calls of the same name slow for everybody."""

from __future__ import annotations

from urbihw.kernel import Kernel
from urbihw.kernel.compiler import compile_node
from urbihw.kernel.compiler.cache import MAX_UNITS
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
    assert not STRICT_NAMES & kernel.host.world.lazy_names.known_to(lobby)
    made = "class K {}|; K.setSlot(\"new\", function { call.args.size })|; "
    text = made + "K.new(1 / 0, x); function f { K.new(undefined) }|; f;"
    assert kernel.run_text(lobby, text) == "[00000000] 2\n[00000000] 1\n"
    assert not STRICT_NAMES & kernel.host.world.lazy_names.known_to(lobby)


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


def test_a_lazy_name_of_one_client_is_unknown_to_the_others_until_they_meet_the_function() -> None:
    kernel = Kernel(SimClock())
    first, second, third = (kernel.open_lobby() for _ in range(3))
    names = kernel.host.world.lazy_names
    library = names.shared
    assert kernel.run_text(first, "function Global.add { call.args.size }|;") == ""
    assert names.known_to(first) == library | {"add"}
    assert names.known_to(second) == names.known_to(third) == names.shared == library
    use = "function use(n) { var k = n; add(k += 1, undefined) + k }|; [use(1), use(5)]; add(undefined);"
    assert kernel.run_text(second, use) == "[00000000] [3, 7]\n[00000000] 1\n"
    assert names.known_to(second) == library | {"add"}
    assert names.known_to(third) == names.shared == library


def test_a_late_argument_is_compiled_once_and_again_after_what_it_depends_on_has_changed() -> None:
    kernel = Kernel(SimClock())
    lobby = kernel.open_lobby()
    text = """
        function use() { var found = []; for| (var i = 0; i < 3; i += 1) found << twice(i * 2); found }|;
        function Global.twice { var a = call.evalArgAt(0) | call.evalArgAt(0) + a }|;
        use;
        """
    assert kernel.run_text(lobby, text) == "[00000000] [0, 4, 8]\n"
    assert kernel.run_text(lobby, "Float.'*' = function(x) { 7 }|; use;") == "[00000000] [14, 14, 14]\n"


def test_a_logical_operator_redefined_by_one_client_counts_for_all() -> None:
    kernel = Kernel(SimClock())
    first, second, third = (kernel.open_lobby() for _ in range(3))
    assert kernel.run_text(third, "function mine { 1 }|;") == ""
    assert kernel.run_text(first, "class Global.Both { function '&&'(x) { \"both\" } }|;") == ""
    for lobby in (second, third):
        assert kernel.run_text(lobby, "Both.new && 1;") == "[00000000] \"both\"\n"


def test_clients_with_and_without_a_lazy_name_share_no_template() -> None:
    kernel = Kernel(SimClock())
    first, second = kernel.open_lobby(), kernel.open_lobby()
    assert kernel.run_text(first, "function lobby.add { call.args.size }|; function Global.sum(a, b) { a + b }|;") == ""
    assert kernel.run_text(second, "function lobby.add(a, b) { a + b }|;") == ""
    for number in range(1, 5):
        assert kernel.run_text(first, f"add({number}, 1 / 0);") == "[00000000] 2\n"
        assert kernel.run_text(second, f"add({number}, 1);") == f"[00000000] {number + 1}\n"


def test_lazy_names_that_a_statement_does_not_use_make_no_further_copy_of_its_code() -> None:
    kernel = Kernel(SimClock())
    lobbies = [kernel.open_lobby() for _ in range(3)]
    for number, lobby in enumerate(lobbies):
        assert kernel.run_text(lobby, f"function mine{number} {{ call.args.size }}|;") == ""
    before = len(kernel.programs.units)
    for lobby in lobbies:
        assert kernel.run_text(lobby, "nil.isNil;") == "[00000000] true\n"
    assert len(kernel.programs.units) == before + 1


def test_the_cache_of_compiled_statements_is_bounded() -> None:
    kernel = Kernel(SimClock())
    lobby = kernel.open_lobby()
    kernel.run_text(lobby, "".join(f"var v{number};" for number in range(MAX_UNITS + 20)))
    assert len(kernel.programs.units) == MAX_UNITS
    kernel.run_text(lobby, "Float.'*' = function(x) { 7 }|; 2 * 3;")
    assert len(kernel.programs.units) <= 2
