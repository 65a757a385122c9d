"""Long functions of generated code, cut into pieces that Python compiles one by one.

Python's own compiler cannot be interrupted: a statement of 20 000 parts would keep everybody waiting for seconds.  So
what is long is cut: a function inside it is compiled apart, and so is a run of statements, which becomes a function
for that.  Such a piece shares the variables of the function it was cut from, as any nested function does, only that
Python did not see the two together.  ``_P(7, lambda: (a, b))`` makes the function of piece 7: the lambda, which is
never called, has the cells of ``a`` and ``b``.

A piece that may leave the function or the loop it was cut from says so by what it returns, and its caller does it.
"""

from __future__ import annotations

import ast as py
import math
from collections.abc import Iterator
from types import CodeType, FunctionType
from typing import Any, Final

from urbihw.kernel import errors
from urbihw.kernel.compiler.emit import LOAD, STORE, Pos, call, const, do, if_, is_, name, position, set_, walrus
from urbihw.kernel.syntax.pace import Pace

WHOLE = 1500
"""A function of at most so many nodes is compiled whole; that takes 2 to 3 ms."""
PIECE = 1000
"""How many nodes a piece should have at the most."""
APART = 200
"""A function inside a long one is compiled apart if it has more nodes than this, and a run of statements is a piece.

What belongs together, as a call and what is done if its function turns out to be lazy, has fewer.
"""
MOST = 10_000
"""What has more nodes than this and cannot be cut is refused; compiling as many takes 20 ms."""
TEMPORARY: Final = frozenset(["_v", "_t", "_c", "_q", "_once", "_each"])
"""Variables that mean something only inside the statement that writes them; pieces do not share them."""
NOWHERE: Final[Pos] = position(0)
"""The position of the calls of pieces: they are no calls of the program."""
BREAK, CONTINUE = 1, 2
"""What a piece returns that wants the loop around it to be left, or its next turn; a value to be returned by the
function is in a tuple, and None means to go on."""
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
        """The function of a piece; ``cells`` is a function that captures what the piece shares."""
        code = self.codes[index]
        shared = dict(zip(cells.__code__.co_freevars, cells.__closure__ or (), strict=True))
        closure = tuple(shared[text] for text in code.co_freevars)
        return FunctionType(code, cells.__globals__, code.co_name, defaults or None, closure or None)


class _Facts:
    """What is known of a stretch of Python: its size, how often it names which variables, which of them it writes, and
    whether it may leave the function or the loop around it.  Functions inside count by what they capture."""

    __slots__ = ("jumps", "names", "returns", "weight", "writes")

    def __init__(self) -> None:
        self.weight = 0
        self.names: dict[str, int] = {}
        self.writes: set[str] = set()
        self.returns = False
        self.jumps = False

    def mention(self, text: str, times: int = 1) -> None:
        """A name is used."""
        self.names[text] = self.names.get(text, 0) + times

    def add(self, other: _Facts, looped: bool = False) -> None:
        """Another stretch belongs to this one; ``looped``: in a loop, which is what its jumps are about."""
        self.weight += other.weight
        for text, times in other.names.items():
            self.mention(text, times)
        self.writes |= other.writes
        self.returns = self.returns or other.returns
        self.jumps = self.jumps or other.jumps and not looped


def code_of(function: py.FunctionDef, shared: list[str] | None = None) -> CodeType:
    """The code of a function that captures ``shared`` variables of a function around it.

    Raises SyntaxError for what Python cannot nest so deep, and RecursionError.
    """
    outer = _function("_around", shared, [function]) if shared else function
    code = compile(py.Module([outer], []), "<urbiscript>", "exec", dont_inherit=True)
    for _ in range(2 if shared else 1):
        code = next(constant for constant in code.co_consts if isinstance(constant, CodeType))
    return code


def cut(function: py.FunctionDef, pace: Pace) -> list[CodeType]:
    """Cut pieces off a top-level function until it is short, and compile them.

    Raises TooLong if that does not make it short, and what ``code_of`` does.
    """
    cutter = _Cutter(pace)
    cutter.cut(function)
    cutter.weigh(function)
    return cutter.codes


class _Cutter:
    """Cuts one unit; ``codes`` are its pieces."""

    def __init__(self, pace: Pace) -> None:
        self.codes: list[CodeType] = []
        self._pace = pace
        self._scopes: list[set[str]] = []

    def weigh(self, function: py.FunctionDef) -> None:
        """Refuse what would take too long to compile."""
        if self._of_function(function).weight > MOST:
            raise errors.TooLong

    def _compile(self, function: py.FunctionDef, shared: list[str]) -> CodeType:
        self.weigh(function)
        code = code_of(function, shared)
        self._pace.pause()
        return code

    # ---------------------------------------------------------------- looking

    def _of_function(self, function: py.FunctionDef) -> _Facts:
        """What is known of a function: its whole size, and the names that it does not declare."""
        known: _Facts | None = vars(function).get("inside")
        if known is None:
            inside = self._of_list(function.body)
            own = inside.writes | _params(function)
            known = _Facts()
            known.weight = inside.weight + len(function.args.args)
            known.names = {text: 1 for text in inside.names if text not in own}
            vars(function)["inside"] = known
        return known

    def _of_list(self, body: list[py.stmt]) -> _Facts:
        facts = _Facts()
        for statement in body:
            inside = self._of(statement)
            facts.add(inside)
            self._pace.step(1 + len(inside.names) // 32)
        return facts

    def _of(self, statement: py.stmt) -> _Facts:
        """What is known of a statement."""
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
                inside = self._of_function(node)
                facts.weight += inside.weight
                facts.writes.add(node.name)
                facts.mention(node.name)
                for text in inside.names:
                    facts.mention(text)
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
                            inside = self._of(each)
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
        if self._of_function(function).weight <= WHOLE:
            return
        written, params = self._of_list(function.body).writes, _params(function)
        self._scopes.append(written | params)
        self._cut_functions(function)
        facts, before = self._of_list(function.body), math.inf
        while WHOLE < facts.weight < before:
            before = facts.weight
            private = {text: times for text, times in facts.names.items() if text in written and text not in params}
            function.body = self._shorten(function.body, private)
            facts = self._of_list(function.body)
        lost = sorted(written.intersection(facts.names) - facts.writes - params)
        if lost:  # only pieces write them now, but they must be variables of this function
            targets: list[py.expr] = [py.Name(text, STORE, **NOWHERE) for text in lost]
            never = if_(const(False, NOWHERE), [py.Assign(targets, const(None, NOWHERE), **NOWHERE)], [], NOWHERE)
            function.body.insert(0, never)
        del vars(function)["inside"]
        self._scopes.pop()

    def _cut_functions(self, function: py.FunctionDef) -> None:
        """Cut the functions inside a function, and compile the longer ones apart."""
        found = False
        for body in self._lists(function.body):
            for place, statement in enumerate(body):
                if isinstance(statement, py.FunctionDef):
                    self.cut(statement)
                    if self._of_function(statement).weight > APART:
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
        """Which names are variables of the functions around."""
        return sorted(text for text in names if text not in TEMPORARY and any(text in own for own in self._scopes))

    def _link(self, code: CodeType, shared: list[str], defaults: list[py.expr]) -> py.expr:
        """The expression that makes the function of a piece."""
        self.codes.append(code)
        captured = py.Tuple([name(text, NOWHERE) for text in shared], LOAD, **NOWHERE)
        nothing = py.arguments(posonlyargs=[], args=[], kwonlyargs=[], kw_defaults=[], defaults=[])
        cells = py.Lambda(nothing, captured, **NOWHERE)
        return call("_P", [const(len(self.codes) - 1, NOWHERE), cells, *defaults], NOWHERE)

    def _apart(self, function: py.FunctionDef) -> py.stmt:
        """A function of its own is compiled apart."""
        facts = self._of_function(function)
        shared = self._shared(facts.names)
        defaults, function.args.defaults = function.args.defaults, []
        code = self._compile(function, shared)
        return set_(function.name, self._link(code, shared, defaults), NOWHERE)

    def _shorten(self, body: list[py.stmt], names: dict[str, int]) -> list[py.stmt]:
        """A list of statements with pieces in place of what is long in it; ``names`` says how often all of the
        function names its variables.  The old list is emptied: to let go of all of it at once would take long."""
        done: list[py.stmt] = []
        run: list[py.stmt] = []
        facts = _Facts()
        body.reverse()
        while body:
            statement = body.pop()
            each = self._of(statement)
            if each.weight > PIECE:
                for part in (statement, *getattr(statement, "handlers", ())):
                    for field in _LISTS:
                        if getattr(part, field, None):
                            setattr(part, field, self._shorten(getattr(part, field), names))
                vars(statement).pop("facts")
                each = self._of(statement)
            if run and facts.weight + each.weight > PIECE:
                done += self._piece(run, facts, names)
                run, facts = [], _Facts()
            run.append(statement)
            facts.add(each)
        return done + self._piece(run, facts, names)

    def _piece(self, run: list[py.stmt], facts: _Facts, names: dict[str, int]) -> list[py.stmt]:
        """A run of statements as a piece that is made and called, if it is worth it."""
        if facts.weight <= APART:
            return run
        private = {text for text in facts.writes if facts.names[text] == names.get(text)}
        shared = [text for text in self._shared(facts.names) if text not in private]
        outside = [text for text in shared if text in facts.writes]
        leaves = facts.returns or facts.jumps
        body = [self._leaving(statement, False) for statement in run] if leaves else run
        head: list[py.stmt] = [py.Nonlocal(outside, **NOWHERE)] if outside else []
        code = self._compile(_function("_piece", [], head + body), shared)
        made = call(self._link(code, shared, []), [], NOWHERE)
        return [_obeying(made, facts) if leaves else do(made, NOWHERE)]

    def _leaving(self, statement: Any, looped: bool) -> Any:
        """A statement of a piece, with what leaves the function or the loop changed into what tells the caller."""
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
                        setattr(part, field, [self._leaving(each, loop) for each in getattr(part, field)])
        return statement


def _function(text: str, params: list[str], body: list[py.stmt]) -> py.FunctionDef:
    args = py.arguments(posonlyargs=[], args=[py.arg(param, None, **NOWHERE) for param in params], kwonlyargs=[],
                        kw_defaults=[], defaults=[])
    made = py.FunctionDef(text, args, body, [], None, **NOWHERE)
    vars(made)["type_params"] = []
    return made


def _params(function: py.FunctionDef) -> set[str]:
    return {arg.arg for arg in function.args.args}


def _obeying(made: py.expr, facts: _Facts) -> py.stmt:
    """The call of a piece that may want to leave, and what is done about it."""
    wish = name("_q", NOWHERE)
    obeyed: list[py.stmt] = []
    if facts.jumps:
        for kind, sign in _JUMPS.items():
            test = py.Compare(wish, [py.Eq()], [const(sign, NOWHERE)], **NOWHERE)
            obeyed.append(if_(test, [kind(**NOWHERE)], [], NOWHERE))
    if facts.returns:
        obeyed.append(py.Return(py.Subscript(wish, const(0, NOWHERE), LOAD, **NOWHERE), **NOWHERE))
    return if_(is_(walrus("_q", made, NOWHERE), const(None, NOWHERE), NOWHERE, negated=True), obeyed, [], NOWHERE)
