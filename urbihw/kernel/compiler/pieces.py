"""Long functions of generated code, cut into pieces that Python compiles one by one.

Python's compiler cannot be interrupted: a statement of 20 000 parts would delay all connections for seconds.  So long
code is cut: nested functions are compiled separately, and so are runs of statements, which become functions.  Such a
piece shares the variables of the function from which it was cut, as any nested function does, although Python does not
compile the two together.  ``_P(7, lambda: (a, b))`` makes the function of piece 7: the lambda, which is never called,
has the cells of ``a`` and ``b``.

A piece that leaves the function or the loop from which it was cut returns a code for that, and its caller does it.
"""

from __future__ import annotations

import ast as py
import math
from collections.abc import Iterator
from types import CodeType, FunctionType
from typing import Any, Final

from urbihw.kernel import errors
from urbihw.kernel.compiler.emit import LOAD, STORE, Pos, call, const, do, if_, is_, name, position, set_, walrus
from urbihw.kernel.syntax.pace import StepPace

MAX_WHOLE_WEIGHT = 1500
"""Maximum number of nodes of a function that is not cut; compiling it takes 2 to 3 ms."""
MAX_PIECE_WEIGHT = 1000
"""Maximum number of nodes that a piece should have."""
MIN_APART_WEIGHT = 200
"""Minimum number of nodes from which a nested function is compiled separately and a run of statements becomes a piece.

Inseparable code, such as a call with its fallback for a lazy function, has fewer nodes.
"""
MAX_WEIGHT = 10_000
"""Maximum number of nodes of code that cannot be cut; compiling it takes 20 ms."""
TEMPORARY: Final = frozenset(["_v", "_t", "_c", "_q", "_once", "_each"])
"""Temporary variables of single statements; pieces do not share them."""
NOWHERE: Final[Pos] = position(0)
"""The position of the calls of pieces, which are no calls of the program."""
BREAK, CONTINUE = 1, 2
"""The return values of a piece for ``break`` and ``continue`` in the enclosing loop.  A tuple contains a value to be
returned by the function, and None means to go on."""
_SIGNS = (py.expr_context, py.operator, py.unaryop, py.boolop, py.cmpop)
_JUMPS = {py.Break: BREAK, py.Continue: CONTINUE}
_LOOPS = (py.For, py.While)
_LISTS = ("body", "orelse", "finalbody")


class Linker:
    """Makes the functions of pieces while a program runs: the ``_P`` of generated code."""

    __slots__ = ("codes",)

    def __init__(self, codes: list[CodeType]) -> None:
        self.codes = codes

    def __call__(self, index: int, cells: FunctionType, *defaults: Any) -> FunctionType:
        """The function of a piece; ``cells`` is a function that captures the shared variables."""
        code = self.codes[index]
        shared = dict(zip(cells.__code__.co_freevars, cells.__closure__ or (), strict=True))
        closure = tuple(shared[text] for text in code.co_freevars)
        return FunctionType(code, cells.__globals__, code.co_name, defaults or None, closure or None)


class _Facts:
    """The facts about a stretch of Python code: its size, the variables with the number of their uses, the written
    variables, and whether it may leave the enclosing function or loop.  For nested functions, the captured variables
    count.
    """

    __slots__ = ("jumps", "names", "returns", "weight", "writes")

    def __init__(self) -> None:
        self.weight = 0
        self.names: dict[str, int] = {}
        self.writes: set[str] = set()
        self.returns = False
        self.jumps = False

    def mention(self, text: str, times: int = 1) -> None:
        """Count uses of a name."""
        self.names[text] = self.names.get(text, 0) + times

    def add(self, other: _Facts, looped: bool = False) -> None:
        """Add the facts of a part; ``looped``: the part is in a loop, to which its jumps belong."""
        self.weight += other.weight
        for text, times in other.names.items():
            self.mention(text, times)
        self.writes |= other.writes
        self.returns = self.returns or other.returns
        self.jumps = self.jumps or other.jumps and not looped

    def add_function(self, name: str, inside: _Facts) -> None:
        """Add the definition of a nested function; ``inside`` are the facts of the function."""
        self.weight += inside.weight
        self.writes.add(name)
        self.mention(name)
        for text in inside.names:
            self.mention(text)


def code_of(function: py.FunctionDef, shared: list[str] | None = None) -> CodeType:
    """The code of a function that captures ``shared`` variables of a function around it.

    Raises SyntaxError or RecursionError if the nesting is too deep for Python.
    """
    outer = _function("_around", shared, [function]) if shared else function
    code = compile(py.Module([outer], []), "<urbiscript>", "exec", dont_inherit=True)
    for _ in range(2 if shared else 1):
        code = next(constant for constant in code.co_consts if isinstance(constant, CodeType))
    return code


def cut(function: py.FunctionDef, pace: StepPace) -> list[CodeType]:
    """Cut pieces off a top-level function until it is short, and compile them.

    Raises StatementTooLong if the function is still too long, and the errors of ``code_of``.
    """
    cutter = _Cutter(pace)
    cutter.cut(function)
    cutter.weigh(function)
    return cutter.codes


class _Cutter:
    """Cuts one unit; ``codes`` are its pieces."""

    def __init__(self, pace: StepPace) -> None:
        self.codes: list[CodeType] = []
        self._pace = pace
        self._scopes: list[set[str]] = []

    def weigh(self, function: py.FunctionDef) -> None:
        """Raise StatementTooLong for a function that would take too long to compile."""
        if self._facts_of_function(function).weight > MAX_WEIGHT:
            raise errors.StatementTooLong

    def _compile(self, function: py.FunctionDef, shared: list[str]) -> CodeType:
        self.weigh(function)
        code = code_of(function, shared)
        self._pace.pause()
        return code

    # ---------------------------------------------------------------- looking

    def _facts_of_function(self, function: py.FunctionDef) -> _Facts:
        """The facts about a function: its size, and the names that it does not declare."""
        known: _Facts | None = vars(function).get("inside")
        if known is None:
            inside = self._facts_of_list(function.body)
            own = inside.writes | _params(function)
            known = _Facts()
            known.weight = inside.weight + len(function.args.args)
            known.names = {text: 1 for text in inside.names if text not in own}
            vars(function)["inside"] = known
        return known

    def _facts_of_list(self, body: list[py.stmt]) -> _Facts:
        facts = _Facts()
        for statement in body:
            inside = self._facts_of(statement)
            facts.add(inside)
            self._pace.step(1 + len(inside.names) // 32)
        return facts

    def _facts_of(self, statement: py.stmt) -> _Facts:
        """The facts about a statement, stored on its node."""
        known: _Facts | None = vars(statement).get("facts")
        if known is not None:
            return known
        facts = vars(statement)["facts"] = _Facts()
        todo: list[tuple[Any, bool]] = [(statement, False)]
        while todo:
            node, looped = todo.pop()
            facts.weight += 1
            if not facts.weight % 8:
                self._pace.step()
            kind = node.__class__
            if kind is py.Name:
                facts.mention(node.id)
                if node.ctx.__class__ is py.Store:
                    facts.writes.add(node.id)
                continue
            if kind is py.FunctionDef:
                facts.add_function(node.name, self._facts_of_function(node))
                continue
            if kind is py.Return:
                facts.returns = True
            elif kind is py.ExceptHandler:
                facts.writes.add(node.name)
                facts.mention(node.name)
            elif kind in _JUMPS:
                facts.jumps = facts.jumps or not looped
            loop = looped or kind in _LOOPS
            for field in node._fields:
                value = getattr(node, field)
                if value.__class__ is list:
                    for each in value:
                        if isinstance(each, py.stmt):
                            inside = self._facts_of(each)
                            facts.add(inside, loop if field == "body" else looped)
                            self._pace.step(len(inside.names) // 32)
                        elif isinstance(each, py.AST):
                            todo.append((each, looped))
                elif isinstance(value, py.AST) and not isinstance(value, _SIGNS):
                    todo.append((value, looped))
        return facts

    # ---------------------------------------------------------------- cutting

    def cut(self, function: py.FunctionDef) -> None:
        """Make a function short by taking pieces out of it."""
        if self._facts_of_function(function).weight <= MAX_WHOLE_WEIGHT:
            return
        written, params = self._facts_of_list(function.body).writes, _params(function)
        self._scopes.append(written | params)
        self._cut_functions(function)
        facts, before = self._facts_of_list(function.body), math.inf
        while MAX_WHOLE_WEIGHT < facts.weight < before:
            before = facts.weight
            private = {text: times for text, times in facts.names.items() if text in written and text not in params}
            function.body = self._shorten(function.body, private)
            facts = self._facts_of_list(function.body)
        lost = sorted(written.intersection(facts.names) - facts.writes - params)
        if lost:  # only pieces write them, but they must remain variables of this function
            targets: list[py.expr] = [py.Name(text, STORE, **NOWHERE) for text in lost]
            never = if_(const(False, NOWHERE), [py.Assign(targets, const(None, NOWHERE), **NOWHERE)], [], NOWHERE)
            function.body.insert(0, never)
        del vars(function)["inside"]
        self._scopes.pop()

    def _cut_functions(self, function: py.FunctionDef) -> None:
        """Cut the nested functions, and compile the longer ones separately."""
        found = False
        for body in self._lists(function.body):
            for place, statement in enumerate(body):
                if isinstance(statement, py.FunctionDef):
                    self.cut(statement)
                    if self._facts_of_function(statement).weight > MIN_APART_WEIGHT:
                        body[place] = self._apart(statement)
                    found = True
        if found:
            for body in self._lists(function.body):
                for statement in body:
                    if isinstance(statement, py.FunctionDef) or any(hasattr(statement, field) for field in _LISTS):
                        vars(statement).pop("facts", None)

    def _lists(self, body: list[py.stmt]) -> Iterator[list[py.stmt]]:
        """The lists of statements of one function."""
        todo: list[list[Any]] = [body]
        while todo:
            each = todo.pop()
            yield each
            for statement in each:
                self._pace.step()
                if not isinstance(statement, py.FunctionDef):
                    for part in (statement, *getattr(statement, "handlers", ())):
                        todo.extend(inner for field in _LISTS if (inner := getattr(part, field, None)))

    def _shared(self, names: dict[str, int]) -> list[str]:
        """The names that are variables of the enclosing functions."""
        return sorted(text for text in names if text not in TEMPORARY and any(text in own for own in self._scopes))

    def _link(self, code: CodeType, shared: list[str], defaults: list[py.expr]) -> py.expr:
        """The expression that makes the function of a piece."""
        self.codes.append(code)
        captured = py.Tuple([name(text, NOWHERE) for text in shared], LOAD, **NOWHERE)
        nothing = py.arguments(posonlyargs=[], args=[], kwonlyargs=[], kw_defaults=[], defaults=[])
        cells = py.Lambda(nothing, captured, **NOWHERE)
        return call("_P", [const(len(self.codes) - 1, NOWHERE), cells, *defaults], NOWHERE)

    def _apart(self, function: py.FunctionDef) -> py.stmt:
        """Compile a nested function separately; return the statement that replaces it."""
        facts = self._facts_of_function(function)
        shared = self._shared(facts.names)
        defaults, function.args.defaults = function.args.defaults, []
        code = self._compile(function, shared)
        return set_(function.name, self._link(code, shared, defaults), NOWHERE)

    def _shorten(self, body: list[py.stmt], names: dict[str, int]) -> list[py.stmt]:
        """Replace the long parts of a list of statements by pieces; ``names`` has the number of uses of the variables
        in the whole function.  The old list is emptied step by step, since freeing it at once would take long.
        """
        done: list[py.stmt] = []
        run: list[py.stmt] = []
        facts = _Facts()
        body.reverse()
        while body:
            statement = body.pop()
            each = self._facts_of(statement)
            if each.weight > MAX_PIECE_WEIGHT:
                for part in (statement, *getattr(statement, "handlers", ())):
                    for field in _LISTS:
                        if getattr(part, field, None):
                            setattr(part, field, self._shorten(getattr(part, field), names))
                vars(statement).pop("facts")
                each = self._facts_of(statement)
            if run and facts.weight + each.weight > MAX_PIECE_WEIGHT:
                done += self._piece(run, facts, names)
                run, facts = [], _Facts()
            run.append(statement)
            facts.add(each)
        return done + self._piece(run, facts, names)

    def _piece(self, run: list[py.stmt], facts: _Facts, names: dict[str, int]) -> list[py.stmt]:
        """Replace a run of statements by a piece and its call, if it is long enough."""
        if facts.weight <= MIN_APART_WEIGHT:
            return run
        private = {text for text in facts.writes if facts.names[text] == names.get(text)}
        shared = [text for text in self._shared(facts.names) if text not in private]
        outside = [text for text in shared if text in facts.writes]
        leaves = facts.returns or facts.jumps
        body = [self._as_result(statement, False) for statement in run] if leaves else run
        head: list[py.stmt] = [py.Nonlocal(outside, **NOWHERE)] if outside else []
        code = self._compile(_function("_piece", [], head + body), shared)
        made = call(self._link(code, shared, []), [], NOWHERE)
        return [_call_of_leaving_piece(made, facts) if leaves else do(made, NOWHERE)]

    def _as_result(self, statement: Any, looped: bool) -> Any:
        """Replace return, break and continue in a statement of a piece by return values for the caller."""
        kind = statement.__class__
        if kind is py.Return:
            statement.value = py.Tuple([statement.value], LOAD, **NOWHERE)
        elif kind in _JUMPS and not looped:
            return py.Return(const(_JUMPS[kind], NOWHERE), **NOWHERE)
        elif kind is not py.FunctionDef:
            for part in (statement, *getattr(statement, "handlers", ())):
                for field in _LISTS:
                    if getattr(part, field, None):
                        loop = looped or kind in _LOOPS and field == "body"
                        setattr(part, field, [self._as_result(each, loop) for each in getattr(part, field)])
        return statement


def _function(text: str, params: list[str], body: list[py.stmt]) -> py.FunctionDef:
    args = py.arguments(posonlyargs=[], args=[py.arg(param, None, **NOWHERE) for param in params], kwonlyargs=[],
                        kw_defaults=[], defaults=[])
    made = py.FunctionDef(text, args, body, [], None, **NOWHERE)
    vars(made)["type_params"] = []
    return made


def _params(function: py.FunctionDef) -> set[str]:
    return {arg.arg for arg in function.args.args}


def _call_of_leaving_piece(made: py.expr, facts: _Facts) -> py.stmt:
    """The call of a piece that may leave, followed by the jump or return that it requests."""
    wish = name("_q", NOWHERE)
    obeyed: list[py.stmt] = []
    if facts.jumps:
        for kind, sign in _JUMPS.items():
            test = py.Compare(wish, [py.Eq()], [const(sign, NOWHERE)], **NOWHERE)
            obeyed.append(if_(test, [kind(**NOWHERE)], [], NOWHERE))
    if facts.returns:
        obeyed.append(py.Return(py.Subscript(wish, const(0, NOWHERE), LOAD, **NOWHERE), **NOWHERE))
    return if_(is_(walrus("_q", made, NOWHERE), const(None, NOWHERE), NOWHERE, negated=True), obeyed, [], NOWHERE)
