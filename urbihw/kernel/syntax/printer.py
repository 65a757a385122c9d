"""Nodes to urbiscript, as the server shows functions, lazy arguments and failed assertions.

Operators are shown as the method calls they are (``1.'+'(2)``), empty argument lists are left out, a block puts each
statement on a line of its own, two blanks further in.  What is printed parses to the same node again, except that
``f()`` becomes ``f`` and that a float is printed with six significant digits, as everywhere in the server.

A node is turned into parts, which are strings, nodes and marks for lines and margins; the parts that are nodes are
turned into parts in turn.  No function calls itself, so that depth is limited by memory only.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from enum import Enum
from typing import Any

from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.ast import Node
from urbihw.kernel.syntax.tokens import escaped, is_identifier


class _Mark(Enum):
    """A new line at the current margin; the margin moved two blanks to the right, or back."""

    LINE = 0
    IN = 1
    OUT = -1


_Part = str | Node | _Mark
_Parts = list[_Part]


def print_node(node: Node) -> str:
    """The text of a node, without a line end after it."""
    todo: _Parts = [node]
    done: list[str] = []
    margin = 0
    while todo:
        part = todo.pop()
        if isinstance(part, str):
            done.append(part)
        elif part is _Mark.LINE:
            done.append("\n" + "  " * margin)
        elif isinstance(part, _Mark):
            margin += part.value
        else:
            todo += reversed(_PRINTERS[type(part)](part))
    return "".join(done)


def print_float(value: float) -> str:
    """A float as the server shows it: in full if it is integral and fits 64 bits, else with six digits."""
    if value.is_integer() and abs(value) < 2**63:
        return str(int(value))
    return f"{value:g}"


def print_name(name: str, member: bool = False) -> str:
    """A name, in quotes if it is not an identifier; after a dot (``member``) ``new`` is one."""
    if is_identifier(name) or member and name == "new":
        return name
    return f"'{escaped(name, quote=chr(39))}'"


# ---------------------------------------------------------------- pieces


def _list(items: Iterable[Node], separator: str = ", ") -> _Parts:
    parts: _Parts = []
    for item in items:
        parts += [separator, item]
    return parts[1:]


def _arguments(args: Sequence[Node] | None) -> _Parts:
    return ["(", *_list(args), ")"] if args else []


def _optional(before: str, node: Node | None) -> _Parts:
    return [] if node is None else [before, node]


# Loosest first; a node of none of these classes binds as tightly as a call.
_OPEN = (ast.Assign, ast.OpAssign, ast.Var)


def _operand(node: Node, *looser: type[Node]) -> _Parts:
    """An operand, in parentheses if it is an assignment, a declaration, or one of the classes given."""
    return ["(", node, ")"] if isinstance(node, (*_OPEN, *looser)) else [node]


def _target(node: Node) -> _Parts:
    """The text before a dot, a bracket or an assignment sign."""
    return _operand(node, ast.And, ast.Or, ast.Postfix)


def _slot(target: Node | None, name: str) -> _Parts:
    if target is None:
        return ["new"] if name == "new" else [print_name(name)]
    return [*_target(target), ".", print_name(name, member=True)]


def _declared(target: Node | None, name: str) -> _Parts:
    return [print_name(name)] if target is None else _slot(target, name)


def _braces(body: _Parts) -> _Parts:
    return ["{", _Mark.IN, _Mark.LINE, *body, _Mark.OUT, _Mark.LINE, "}"] if body else ["{}"]


def _flavor(flavor: str, default: str) -> str:
    return " " if flavor == default else flavor + " "


# ---------------------------------------------------------------- literals and messages


def _string(node: ast.StringLiteral) -> _Parts:
    return [f'"{escaped(node.value)}"']


def _tuple(node: ast.TupleLit) -> _Parts:
    return ["(", *_list(node.items), ",)" if len(node.items) == 1 else ")"]


def _dictionary(node: ast.DictLit) -> _Parts:
    parts: _Parts = []
    for key, value in node.pairs:
        parts += [", ", key, " => ", value]
    return ["[", *parts[1:], "]"] if parts else ["[ => ]"]


def _call(node: ast.Call) -> _Parts:
    if node.args == () and is_identifier(node.name):
        return [*_slot(node.target, node.name), "()"]
    return [*_slot(node.target, node.name), *_arguments(node.args)]


def _and(node: ast.And) -> _Parts:
    return [*_operand(node.left, ast.Or), " && ", *_operand(node.right, ast.Or, ast.And)]


def _or(node: ast.Or) -> _Parts:
    return [*_operand(node.left), " || ", *_operand(node.right, ast.Or)]


def _property(node: ast.Property) -> _Parts:
    return [node.slot, "->", print_name(node.name)]


def _var(node: ast.Var) -> _Parts:
    start = "const var " if node.const else "var "
    return [start, *_declared(node.target, node.name), *_optional(" = ", node.value)]


def _assign(node: ast.Assign) -> _Parts:
    # `x = (y = 1) time: 1s`: without the parentheses the modifier would be that of y.
    value: _Parts = _operand(node.value) if node.modifiers else [node.value]
    parts = [*_target(node.place), " = ", *value]
    for name, setting in node.modifiers:
        parts += [f" {print_name(name)}: ", *_operand(setting)]
    return parts


def _in_place(node: ast.OpAssign) -> _Parts:
    return [*_place(node.place), f" {node.op} ", node.value]


def _postfix(node: ast.Postfix) -> _Parts:
    return [*_place(node.place), node.op]


def _place(place: Node) -> _Parts:
    """The operand that an operator modifies.  A subscript keeps its brackets, since ``a.'[]'(0) += 1`` is invalid."""
    if isinstance(place, ast.Call) and place.name == "[]" and place.args is not None and place.target is not None:
        return [*_target(place.target), "[", *_list(place.args), "]"]
    return _target(place)


# ---------------------------------------------------------------- functions and objects


def _formal(node: ast.Formal) -> _Parts:
    name = f"var {print_name(node.name)}"
    return [name + "[]"] if node.variadic else [name, *_optional(" = ", node.default)]


def _function(node: ast.Function) -> _Parts:
    formals: _Parts = [] if node.formals is None else ["(", *_list(node.formals), ") "]
    return ["closure " if node.closure else "function ", *formals, node.body]


def _do(node: ast.Do) -> _Parts:
    return ["do (", node.target, ") ", node.body]


def _class(node: ast.Class) -> _Parts:
    protos: _Parts = [" : ", *_list(node.protos)] if node.protos else []
    return ["class ", *_declared(node.target, node.name), *protos, " ", node.body]


def _external(node: ast.External) -> _Parts:
    arity = "" if node.arity is None else f" ({print_float(node.arity)})"
    path = ".".join(print_name(name) for name in node.path)
    source = "" if node.source is None else f" from {print_name(node.source)}"
    return [f"external {node.kind}{arity} {path}{source}"]


# ---------------------------------------------------------------- composition


def _sequence(node: ast.Seq) -> _Parts:
    parts: _Parts = []
    for statement, separator in node.items:
        parts += [_Mark.LINE, statement, separator]
    return parts[1:]


def _joined(separator: str) -> Callable[[Any], _Parts]:
    """Statements joined by a separator; an empty one at the end leaves the separator."""

    def parts_of(node: ast.Pipe | ast.Par) -> _Parts:
        parts = _list(node.items, f" {separator} ")
        if isinstance(node.items[-1], ast.Empty):
            parts[-2:] = [f" {separator}"]
        return parts

    return parts_of


def _scope(node: ast.Scope) -> _Parts:
    return _braces([] if node.body is None else [node.body])


# ---------------------------------------------------------------- flow control


def _if(node: ast.If) -> _Parts:
    return ["if (", node.cond, ") ", node.then, *_optional(" else ", node.otherwise)]


def _while(node: ast.While) -> _Parts:
    if node.cond is None:
        return [f"loop{_flavor(node.flavor, ';')}", node.body]
    return [f"while{_flavor(node.flavor, ';')}(", node.cond, ") ", node.body]


def _for(node: ast.For) -> _Parts:
    return [f"for{_flavor(node.flavor, ';')}(", node.init, "; ", node.cond, "; ", node.step, ") ", node.body]


def _for_each(node: ast.ForEach) -> _Parts:
    variable = "" if node.name is None else f"var {print_name(node.name)} : "
    return [f"for{_flavor(node.flavor, ';')}({variable}", node.items, ") ", node.body]


def _switch(node: ast.Switch) -> _Parts:
    cases: _Parts = []
    for case in node.cases:
        cases += [_Mark.LINE, case]
    return ["switch (", node.value, ") ", *_braces(cases[1:])]


def _case(node: ast.Case) -> _Parts:
    head: _Parts = (
        ["default:"] if node.pattern is None else ["case ", node.pattern, *_optional(" if ", node.guard), ":"]
    )
    return head if node.body is None else [*head, _Mark.IN, _Mark.LINE, node.body, _Mark.OUT]


def _try(node: ast.Try) -> _Parts:
    parts: _Parts = ["try ", node.body]
    for clause in node.catches:
        parts += [" ", clause]
    return [*parts, *_optional(" else ", node.otherwise), *_optional(" finally ", node.final)]


def _catch(node: ast.Catch) -> _Parts:
    if node.pattern is None:
        return ["catch ", node.body]
    return ["catch (", node.pattern, *_optional(" if ", node.guard), ") ", node.body]


def _assert(node: ast.Assert) -> _Parts:
    if len(node.claims) == 1:
        return ["assert(", node.claims[0], ")"]
    claims: _Parts = []
    for claim in node.claims:
        claims += [_Mark.LINE, claim, ";"]
    return ["assert ", *_braces(claims[1:])]


# ---------------------------------------------------------------- time and events


def _emit(node: ast.Emit) -> _Parts:
    args: _Parts = [] if node.args is None else ["(", *_list(node.args), ")"]
    return [node.event, "!", *args, *_optional(" ~ ", node.duration)]


def _event_condition(node: ast.EventCond) -> _Parts:
    patterns: _Parts = [] if node.patterns is None else ["(", *_list(node.patterns), ")"]
    return [node.event, "?", *patterns, *_optional(" if ", node.guard), *_optional(" ~ ", node.duration)]


def _at(node: ast.At) -> _Parts:
    return ["at sync (" if node.sync else "at (", node.cond, ") ", node.body, *_optional(" onleave ", node.leave)]


def _whenever(node: ast.Whenever) -> _Parts:
    return ["whenever (", node.cond, ") ", node.body, *_optional(" else ", node.otherwise)]


def _every(node: ast.Every) -> _Parts:
    return [f"every{_flavor(node.flavor, ',')}(", node.period, ") ", node.body]


_PRINTERS: dict[type[Node], Callable[[Any], _Parts]] = {
    ast.Float: lambda node: [print_float(node.value)],
    ast.StringLiteral: _string,
    ast.ListLit: lambda node: ["[", *_list(node.items), "]"],
    ast.TupleLit: _tuple,
    ast.DictLit: _dictionary,
    ast.This: lambda node: ["this"],
    ast.CallKeyword: lambda node: ["call"],
    ast.Call: _call,
    ast.And: _and,
    ast.Or: _or,
    ast.Property: _property,
    ast.Var: _var,
    ast.Assign: _assign,
    ast.OpAssign: _in_place,
    ast.Postfix: _postfix,
    ast.Formal: _formal,
    ast.Function: _function,
    ast.External: _external,
    ast.Do: _do,
    ast.Class: _class,
    ast.Empty: lambda node: [],
    ast.Seq: _sequence,
    ast.Pipe: _joined("|"),
    ast.Par: _joined("&"),
    ast.Scope: _scope,
    ast.If: _if,
    ast.While: _while,
    ast.For: _for,
    ast.ForEach: _for_each,
    ast.Break: lambda node: ["break"],
    ast.Continue: lambda node: ["continue"],
    ast.Return: lambda node: ["return", *_optional(" ", node.value)],
    ast.Switch: _switch,
    ast.Case: _case,
    ast.Try: _try,
    ast.Catch: _catch,
    ast.Throw: lambda node: ["throw", *_optional(" ", node.value)],
    ast.Assert: _assert,
    ast.Tagged: lambda node: [node.tag, ": ", node.body],
    ast.Emit: _emit,
    ast.EventCond: _event_condition,
    ast.ExprCond: lambda node: [node.expr, *_optional(" ~ ", node.duration)],
    ast.At: _at,
    ast.Whenever: _whenever,
    ast.WaitUntil: lambda node: ["waituntil (", node.cond, ")"],
    ast.Every: _every,
    ast.Guarded: lambda node: [f"{node.kind} (", node.cond, ") ", node.body],
}
