"""Expressions to Python expressions.

An urbiscript expression may contain statements (``1 + { ...; 2 }``), a Python one may not: what needs statements writes
them before the statement under construction and leaves a variable behind.  ``sequence`` keeps the order of evaluation:
when a later operand writes statements, the earlier ones are put into variables first.
"""

from __future__ import annotations

import ast as py
from collections.abc import Callable, Sequence
from typing import Any

from urbihw.kernel.compiler.emit import (
    LOAD,
    STORE,
    Emitter,
    Pos,
    attr,
    call,
    choose,
    const,
    if_,
    is_,
    is_pure,
    list_,
    name,
    set_,
    tuple_,
    walrus,
)
from urbihw.kernel.compiler.scopes import OPERATIONS, spine
from urbihw.kernel.compiler.unit import FunctionInfo
from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.location import Span

ARITHMETIC = {"+": py.Add, "-": py.Sub, "*": py.Mult, "/": py.Div}
COMPARISONS = {"<": py.Lt, "<=": py.LtE, ">": py.Gt, ">=": py.GtE}
INPLACE = {"+=": py.Add, "-=": py.Sub, "*=": py.Mult, "/=": py.Div}
EQUALITY = {"==": "equal", "!=": "unequal"}
CONSTANTS = {"true": "TRUE", "false": "FALSE", "nil": "NIL", "void": "VOID"}
CHOICES = (ast.And, ast.Or)
PIECE = 100
"""How many operations of a sum, or parts of a list, make one Python expression."""
HEAVY = 300
"""How many parts may be written for one Python expression; Python compiles them in one go, in 2 ms."""
NEVER_VOID = (ast.Float, ast.String, ast.ListLit, ast.TupleLit, ast.DictLit, ast.This, ast.CallMessage, ast.Function)

Maker = Callable[[], py.expr]


class Expressions(Emitter):
    """Methods ``x_Node`` give a Python expression for the value of a node."""

    def expr(self, node: ast.Node) -> py.expr:
        """The value of a node; it may be void."""
        if isinstance(node, OPERATIONS):
            piece = self.piece(node, OPERATIONS, self.expr)
            if piece is not None:
                return piece
        method = getattr(self, "x_" + type(node).__name__, None)
        if method is not None:
            begun = self.unkept()
            made: py.expr = method(node)
            if self.unkept() - begun > HEAVY:
                variable = self.fresh()
                self.emit(set_(variable, made, position(made)))
                self.keep(begun)
                return name(variable, position(made))
            return made
        variable, begun = self.fresh(), self.unkept()
        self.stmt(node, variable)
        self.keep(begun)
        return name(variable, self.mark(node))

    def stmt(self, node: ast.Node, dest: str | None) -> None:
        """Write a node as a statement (see ``Statements``)."""
        raise NotImplementedError

    def piece(
        self, node: ast.Node, kinds: tuple[type[ast.Node], ...], make: Callable[[ast.Node], py.expr]
    ) -> py.expr | None:
        """The variable that holds the left part of a very long sum, if the node is such a part; else None.

        A sum of hundreds of terms is computed in pieces, from the left, each put into a variable: neither we nor
        Python's compiler could walk it in one.  ``make`` makes the operations of these ``kinds``.
        """
        known = self.pieces.get(id(node))
        if known is not None:
            return name(known, self.mark(node)) if known else None
        parts = spine(node, self.pace, kinds)
        if len(parts) > PIECE:
            for part in parts:
                self.pace.step()
                self.pieces[id(part)] = ""
            for part in parts[-PIECE:0:-PIECE]:
                variable = self.fresh()
                self.emit(set_(variable, make(part), self.mark(part)))
                self.pieces[id(part)] = variable
        return None

    def value(self, node: ast.Node, where: Span | None = None) -> py.expr:
        """The value of a node where void is an error, which points at the node or at ``where``."""
        made = self.expr(node)
        if self.never_void(node):
            return made
        p = self.mark_span(node.span if where is None else where)
        is_value = is_(walrus("_v", made, p), name("VOID", p), p, negated=True)
        return choose(is_value, name("_v", p), call("no_void", [], p), p)

    def never_void(self, node: ast.Node) -> bool:
        """Whether the value of a node is certainly not void."""
        if isinstance(node, NEVER_VOID):
            return True
        if isinstance(node, ast.Call):
            if self.is_operator(node):
                return True
            local = self.binding.locals.get(id(node))
            if local is not None and node.args is None:
                return not local.maybe_void
            return node.target is None and node.args is None and node.name in ("true", "false", "nil") and local is None
        return False

    def operand(self, node: ast.Node) -> py.expr:
        """A value that is used at once and kept by nobody: a literal need not be a fresh object."""
        if isinstance(node, ast.Float):
            return const(node.value, self.mark(node))
        return self.expr(node)

    def condition(self, node: ast.Node) -> py.expr:
        """A Python expression whose truth is that of the node."""
        if self.pieces.get(id(node)):
            return self.expr(node)
        if isinstance(node, ast.Call) and node.target is not None and not self.generic:
            if node.name in COMPARISONS and node.args is not None and len(node.args) == 1:
                return self.comparison(node, node.target, node.args[0])
            if node.name == "!" and not node.args:
                return py.UnaryOp(py.Not(), self.condition(node.target), **self.mark(node))
        if isinstance(node, ast.Call) and node.target is not None and self.equality(node):
            return self.raw_equality(node)
        if isinstance(node, CHOICES):
            return self.piece(node, CHOICES, self.condition) or self.short_circuit(node, self.condition)
        return self.operand(node)

    def sequence(self, makers: Sequence[Maker]) -> list[py.expr]:
        """Make expressions that are evaluated in order, whatever statements each of them writes."""
        made: list[py.expr] = []
        kept = 0
        for maker in makers:
            mark = len(self.w.out)
            expression = maker()
            if made and any(not is_pure(statement) for statement in self.w.out[mark:]):
                spills: list[py.stmt] = []
                for i, earlier in enumerate(made[kept:], kept):
                    if not isinstance(earlier, py.Constant):
                        variable = self.fresh()
                        p = position(earlier)
                        spills.append(set_(variable, earlier, p))
                        made[i] = name(variable, p)
                self.w.out[mark:mark] = spills
                kept = len(made)
            made.append(expression)
        return made

    def list_of(self, nodes: Sequence[ast.Node], make: Callable[[ast.Node], py.expr], p: Pos) -> py.List | py.Name:
        """A Python list of what ``make`` makes of each node, evaluated in order.

        It is put together from pieces in a variable if it is long, or if making one of its parts takes statements.
        """
        variable, begun = "", self.unkept()
        made: list[py.expr] = []

        def more() -> py.stmt:
            nonlocal variable, made
            part, made = list_(made, p), []
            if variable:
                return py.AugAssign(py.Name(variable, STORE, **p), py.Add(), part, **p)
            variable = self.fresh()
            return set_(variable, part, p)

        for node in nodes:
            mark = len(self.w.out)
            expression = make(node)
            if made and any(not is_pure(statement) for statement in self.w.out[mark:]):
                self.w.out.insert(mark, more())
            made.append(expression)
            if len(made) == PIECE or self.unkept() - begun > HEAVY:
                self.emit(more())
                self.keep(begun)
        if not variable:
            return list_(made, p)
        if made:
            self.emit(more())
            self.keep(begun)
        return name(variable, p)

    # ---------------------------------------------------------------- literals

    def x_Float(self, node: ast.Float) -> py.expr:
        p = self.mark(node)
        return py.BinOp(const(node.value, p), py.Add(), name("ZERO", p), **p)

    def x_String(self, node: ast.String) -> py.expr:
        p = self.mark(node)
        return call("new_string", [const(node.value, p)], p)

    def x_ListLit(self, node: ast.ListLit) -> py.expr:
        p = self.mark(node)
        return call("new_list", [self.list_of(node.items, self.value, p)], p)

    def x_TupleLit(self, node: ast.TupleLit) -> py.expr:
        p = self.mark(node)
        return call("new_tuple", [self.list_of(node.items, self.value, p)], p)

    def x_DictLit(self, node: ast.DictLit) -> py.expr:
        p = self.mark(node)
        flat = [part for pair in node.pairs for part in pair]
        return call("new_dictionary", [self.list_of(flat, self.value, p)], p)

    def x_Function(self, node: ast.Function) -> py.expr:
        raise NotImplementedError

    # ---------------------------------------------------------------- names and messages

    def x_This(self, node: ast.This) -> py.expr:
        return self.this(node, self.mark(node))

    def x_CallMessage(self, node: ast.CallMessage) -> py.expr:
        return self.read(self.binding.locals[id(node)], self.mark(node))

    def x_Call(self, node: ast.Call) -> py.expr:
        local = self.binding.locals.get(id(node))
        if local is not None:
            if local.name == "scopeTag" and node.name in ("scopeTag", "scope"):
                return self.read(local, self.mark(node))
            if node.args is None:
                return self.read(local, self.mark(node))
            return self.call_local(node, self.read(local, self.mark(node)))
        if node.target is None and node.args is None and node.name in CONSTANTS:
            return name(CONSTANTS[node.name], self.mark(node))
        if self.is_operator(node):
            return self.operator(node)
        if node.target is None:
            return self.send(node, lambda: self.this(node, self.mark(node)))
        target = node.target
        return self.send(node, lambda: self.expr(target))

    def send(self, node: ast.Call, target: Maker) -> py.expr:
        """A message to a target."""
        if node.name in self.binding.lazy_names:
            return self.send_lazy(node, target)
        if not node.args:
            made = target()
            p = self.mark(node, node.name)
            return call("send0", [made, const(node.name, p)], p)
        receiver = target()
        p = self.mark(node, node.name)
        if isinstance(receiver, py.Name):
            first, again = receiver, name(receiver.id, p)
        else:
            variable = self.fresh("_o")
            first, again = walrus(variable, receiver, p), name(variable, p)  # type: ignore[assignment]
        return self.apply(node, call("method", [first, const(node.name, p)], p), again, p)

    def call_local(self, node: ast.Call, function: py.expr) -> py.expr:
        """Call what a local variable holds, with ``this`` as its target."""
        p = self.mark(node, node.name)
        this = self.this(node, p)
        if node.name in self.binding.lazy_names and node.args:
            return call("lazy_value", [function, this, const(node.name, p), *self.thunks(node.args, p)], p)
        return self.apply(node, call("callee", [function], p), this, p)

    def apply(self, node: ast.Call, function: py.expr, target: py.expr, p: Pos) -> py.expr:
        """Call ``function`` strictly, or, if it turns out to be lazy, with its arguments unevaluated."""
        args = node.args or ()
        verb = f"c{len(args)}" if len(args) <= 3 else "cn"
        made: list[py.expr] = []
        before = self.block(lambda: made.extend(self.arguments(args, p)))
        found = name("_t", p)
        strict = attr(walrus("_t", function, p), "strict", p)
        late = [found, target, self.this(node, p), const(node.name, p), const(self.late_site(node), p)]
        if all(is_pure(statement) for statement in before):
            self.emit(*before)
            now = call(walrus("_c", attr(found, verb, p), p), [target, *made], p)
            return choose(strict, now, call("lazy_site", late, p), p)
        kept, result = self.fresh("_t"), self.fresh()
        self.emit(set_(kept, function, p))
        late[0] = name(kept, p)
        done = [*before, set_(result, call(attr(name(kept, p), verb, p), [target, *made], p), p)]
        self.emit(if_(attr(name(kept, p), "strict", p), done, [set_(result, call("lazy_site", late, p), p)], p))
        return name(result, p)

    def arguments(self, args: tuple[ast.Node, ...], p: Pos) -> list[py.expr]:
        """Strict arguments: void is an error."""
        made = self.list_of(args, self.value, p)
        return made.elts if isinstance(made, py.List) else [py.Starred(made, LOAD, **p)]

    def late_site(self, node: ast.Call) -> int:
        """Remember a call whose function may turn out to be lazy; the number of the site."""
        raise NotImplementedError

    def send_lazy(self, node: ast.Call, target: Maker) -> py.expr:
        """A message by a name known to belong to a lazy function."""
        receiver = target()
        p = self.mark(node, node.name)
        args = [receiver, self.this(node, p), const(node.name, p), *self.thunks(node.args or (), p)]
        return call("lazy_send", args, p)

    def thunks(self, args: tuple[ast.Node, ...], p: Pos) -> list[py.expr]:
        """Unevaluated arguments: a list of functions, and a list of their syntax."""
        return [self.list_of(args, self.thunk, p), self.nodes(args, p)]

    def thunk(self, node: ast.Node) -> py.expr:
        """A node as a Python function without parameters (see ``Statements``)."""
        raise NotImplementedError

    # ---------------------------------------------------------------- operators

    def is_operator(self, node: ast.Call) -> bool:
        """Whether a call is one that Python's own operator serves."""
        if node.target is None or self.generic:
            return False
        count = len(node.args or ())
        if count == 0:
            return node.name == "!" or (node.name == "-" and node.args is None)
        return count == 1 and (node.name in ARITHMETIC or node.name in COMPARISONS or node.name in EQUALITY
                               or node.name in ("===", "!==", "<<"))

    def operator(self, node: ast.Call) -> py.expr:
        """A call served by a Python operator."""
        assert node.target is not None
        if not node.args:
            if node.name == "!":
                made = self.condition(node)
                p = self.mark(node, node.name)
                return choose(made, name("TRUE", p), name("FALSE", p), p)
            operand = self.operand(node.target)
            p = self.mark(node, node.name)
            if isinstance(operand, py.Constant):
                return py.BinOp(name("ZERO", p), py.Sub(), operand, **p)
            return py.UnaryOp(py.USub(), operand, **p)
        left, right = node.target, node.args[0]
        if node.name in COMPARISONS:
            return self.truth(self.comparison(node, left, right), node)
        if node.name == "+" and isinstance(right, ast.String):
            text = const(right.value, self.mark(right))
            return call("join", [self.operand(left), text], self.mark(node, node.name))
        if node.name in ARITHMETIC:
            a, b = self.sequence([lambda: self.operand(left), lambda: self.operand(right)])
            if isinstance(a, py.Constant) and isinstance(b, py.Constant):
                a = self.expr(left)
            return py.BinOp(a, ARITHMETIC[node.name](), b, **self.mark(node, node.name))
        if node.name in EQUALITY:
            return self.truth(self.raw_equality(node), node)
        if node.name == "<<":
            return call("push", self.sequence([lambda: self.expr(left), lambda: self.value(right)]),
                        self.mark(node, node.name))
        a, b = self.sequence([lambda: self.value(left), lambda: self.value(right)])
        p = self.mark(node, node.name)
        return choose(is_(a, b, p, negated=node.name == "!=="), name("TRUE", p), name("FALSE", p), p)

    def comparison(self, node: ast.Call, left: ast.Node, right: ast.Node) -> py.expr:
        """``left < right`` and so on: a Python bool, or whatever an object's operator gives."""
        a, b = self.sequence([lambda: self.operand(left), lambda: self.operand(right)])
        return py.Compare(a, [COMPARISONS[node.name]()], [b], **self.mark(node, node.name))

    def equality(self, node: ast.Call) -> bool:
        """Whether a call is ``==`` or ``!=`` as an operator."""
        return node.name in EQUALITY and node.args is not None and len(node.args) == 1

    def raw_equality(self, node: ast.Call) -> py.expr:
        """``left == right``: a Python bool, or whatever an object's operator gives."""
        assert node.target is not None and node.args is not None
        left, right = node.target, node.args[0]
        args = self.sequence([lambda: self.operand(left), lambda: self.operand(right)])
        return call(EQUALITY[node.name], args, self.mark(node, node.name))

    def truth(self, made: py.expr, node: ast.Node) -> py.expr:
        """A Python bool as true or false; anything else as it is."""
        p = self.mark(node)
        is_bool = is_(attr(walrus("_v", made, p), "__class__", p), name("bool", p), p)
        return choose(is_bool, choose(name("_v", p), name("TRUE", p), name("FALSE", p), p), name("_v", p), p)

    def x_And(self, node: ast.And) -> py.expr:
        return self.short_circuit(node, self.expr)

    def x_Or(self, node: ast.Or) -> py.expr:
        """``||``; of two events it makes a third, and their truth has no say."""
        left = self.expr(node.left)
        right: list[py.expr] = []
        before = self.block(lambda: right.append(self.expr(node.right)))
        p = self.mark(node, "||")
        variable = self.fresh("_o")
        self.emit(set_(variable, left, p))
        event = is_(attr(name(variable, p), "__class__", p), name("Event", p), p)
        joined = choose(event, call("either", [name(variable, p), right[0]], p), right[0], p)
        test = py.BoolOp(py.Or(), [event, py.UnaryOp(py.Not(), name(variable, p), **p)], **p)
        self.emit(if_(test, [*before, set_(variable, joined, p)], [], p))
        return name(variable, p)

    def short_circuit(self, node: ast.And | ast.Or, make: Callable[[ast.Node], py.expr]) -> py.expr:
        """``&&`` and ``||``: the right side is evaluated only if it decides."""
        left = make(node.left)
        right: list[py.expr] = []
        before = self.block(lambda: right.append(make(node.right)))
        p = self.mark(node)
        both = isinstance(node, ast.And)
        if not any(not is_pure(statement) for statement in before):
            self.emit(*before)
            return py.BoolOp(py.And() if both else py.Or(), [left, right[0]], **p)
        variable = self.fresh()
        self.emit(set_(variable, left, p))
        test: py.expr = name(variable, p)
        if not both:
            test = py.UnaryOp(py.Not(), test, **p)
        self.emit(if_(test, [*before, set_(variable, right[0], p)], [], p))
        return name(variable, p)

    # ---------------------------------------------------------------- properties

    def slot_holder(self, slot: ast.Call, node: ast.Node) -> Maker:
        """The object whose slot is meant by ``a`` or ``o.a``."""
        target = slot.target
        if target is None:
            return lambda: self.this(node, self.mark(node))
        return lambda: self.value(target)

    def x_External(self, node: ast.External) -> py.expr:
        """``external function (2) X.f from X``."""
        p = self.mark(node)
        words = (node.kind, ".".join(node.path), node.arity, node.source)
        return call("external", [const(word, p) for word in words], p)

    def x_Property(self, node: ast.Property) -> py.expr:
        holder = self.slot_holder(node.slot, node)()
        p = self.mark(node, "getProperty")
        return call("get_property", [holder, const(node.slot.name, p), const(node.name, p)], p)

    # ---------------------------------------------------------------- patterns

    def pattern(self, node: ast.Node) -> py.expr:
        """A pattern as the tuple that ``runtime.matching`` describes."""
        p = self.mark(node)
        if isinstance(node, ast.Var) and node.target is None and node.value is None:
            return tuple_([const("bind", p)], p)
        if isinstance(node, ast.ListLit | ast.TupleLit):
            kind = "list" if isinstance(node, ast.ListLit) else "tuple"
            return tuple_([const(kind, p), self.list_of(node.items, self.pattern, p)], p)
        if isinstance(node, ast.DictLit):
            pairs: list[py.expr] = [tuple_([self.value(key), self.pattern(item)], p) for key, item in node.pairs]
            return tuple_([const("dict", p), list_(pairs, p)], p)
        return tuple_([const("value", p), self.value(node)], p)

    # ---------------------------------------------------------------- function literals

    def info(self, node: ast.Function, uses_call: bool) -> FunctionInfo:
        """What is known of a function literal."""
        formals = node.formals or ()
        variadic = bool(formals) and formals[-1].variadic
        least = sum(1 for formal in formals if formal.default is None and not formal.variadic)
        most = -1 if variadic or node.formals is None else len(formals)
        index = self.syntax.add(node)
        return FunctionInfo(
            least, most, node.formals is None, uses_call, node.closure, len(formals), self.syntax, index
        )


def position(node: Any) -> Pos:
    """The position of a Python node made by an ``Emitter``."""
    line = node.lineno
    return {"lineno": line, "col_offset": 0, "end_lineno": line, "end_col_offset": 0}
