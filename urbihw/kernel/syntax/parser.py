"""Tokens in, nodes out: the LALR machine, its error recovery, and the wording of errors.

The machine is the usual one: it has a stack of states, and each token is shifted or causes reductions.  It takes one
token at a time, so that a statement may arrive in any number of packets, and it never recurses, so that only memory
limits the depth.  Nodes are made while reducing.

**After an error** it does what yacc does, since the original's answers depend on it: states are taken off the stack
until one is found that accepts ERROR; then tokens are skipped until one comes that may follow ERROR in that state.
The grammar has ERROR in three places: as a whole statement, and alone between braces or between the parentheses of a
group.  So what is skipped ends at the first ``}`` or ``)`` of the innermost open block or group, whatever stands
between, else at the next ``;`` or ``,``.  Until three tokens have been accepted again, further errors are not
reported.  Nothing of the statement runs (server protocol, section 2).
"""

from __future__ import annotations

from collections import Counter
from functools import lru_cache, partial
from typing import Any, Final

from urbihw.kernel.syntax import ast, expressions, statements
from urbihw.kernel.syntax.check import CHECKED, check
from urbihw.kernel.syntax.location import Span
from urbihw.kernel.syntax.pace import StepPace
from urbihw.kernel.syntax.rules import Action, Problem, Problems
from urbihw.kernel.syntax.statements import StatementCommand
from urbihw.kernel.syntax.tables import load_tables
from urbihw.kernel.syntax.tokens import CONTEXTUAL, CONTEXTUAL_INSIDE, Token, shown

_new: Final = tuple.__new__
"""Makes a named tuple of a tuple, in half the time that its own constructor takes."""

# Lark's name for the end of the input of the start rule.
_ACCEPT = "$END"

# The tail ", expecting A or B" names at most this many kinds, in this order; a set with others is not shown.
_MOST_EXPECTED = 4
_EXPECTED = ["END", "=", "[", "(", ")", "]", ",", ";", ":", "case", "catch", "default", "finally", "}", "var", "NAME"]
_UNTOLD = frozenset(["ERROR", "assert", *CONTEXTUAL_INSIDE])
_OPENERS = frozenset(["{", "(", "["])
_CLOSERS = frozenset(["}", ")", "]"])

UNEXPECTED: Final = "unexpected"
"""The beginning of a message about a token that the grammar does not accept."""
# Number of tokens that must be accepted after an error before another error is reported: the rule of yacc.
_QUIET = 3


Plan = tuple[str, int, tuple[int, ...] | None, Action | None]
"""How to reduce by a rule: its name, its number of symbols, the symbols that its function gets (None: all), the
function."""


@lru_cache(maxsize=1)
def _plans() -> tuple[list[Plan], list[int]]:
    """The plans of all rules, and the numbers of those whose functions report problems."""
    makers = {**expressions.RULES.makers, **statements.RULES.makers}
    reporters = {**expressions.RULES.reporters, **statements.RULES.reporters}
    plans: list[Plan] = []
    reporting = []
    for number, rule in enumerate(load_tables().rules):
        action = None if rule.action is None else makers.get(rule.action)
        if action is None and rule.action is not None:
            action = reporters[rule.action]
            reporting.append(number)
        kept = None if action is not None and rule.kept == tuple(range(rule.size)) else rule.kept
        plans.append((rule.origin, rule.size, kept, action))
    return plans, reporting


class Parser:
    """Parses one statement after the other.

    ``push`` accepts a token and returns whether it completes a statement; ``take_command`` then returns the statement.
    ``problems`` collects what is wrong with the present statement, from the lexer too, in order of appearance.
    """

    def __init__(self) -> None:
        self.problems: Problems = []
        self._tables = load_tables()
        self._rows = self._tables.rows
        plans, reporting = _plans()
        self._plans = plans.copy()
        for number in reporting:
            origin, size, kept, action = plans[number]
            assert action is not None
            self._plans[number] = (origin, size, kept, partial(action, self.problems))
        self._begin()

    def _begin(self) -> None:
        self._states: list[int] = [0]
        self._values: list[Any] = []
        self._spans: list[Span] = []
        self._shifted = 0
        self._quiet = 0
        self._doubtful = False
        self._resume: dict[str, int] | None = None

    @property
    def idle(self) -> bool:
        """Whether no token of the current statement has arrived yet."""
        return len(self._states) == 1

    @property
    def depth(self) -> int:
        """Number of unfinished symbols of the current statement; an open bracket is at least one."""
        return len(self._states)

    def open_brackets(self) -> int:
        """Number of open brackets of the current statement."""
        kinds = [value.kind for value in self._values if type(value) is Token]
        return sum(kind in _OPENERS for kind in kinds) - sum(kind in _CLOSERS for kind in kinds)

    def discard(self) -> None:
        """Discard the current statement."""
        self._begin()
        self.problems.clear()

    def take_command(self, pace: StepPace) -> StatementCommand:
        """The complete statement.  Errors that the grammar does not detect are added to the problems."""
        command, doubtful = self._values[-1], self._doubtful
        assert isinstance(command, StatementCommand)
        self._begin()
        if doubtful and command.node is not None and all(problem.warning for problem in self.problems):
            self.problems.extend(check(command.node, pace))
        return command

    def push(self, token: Token) -> bool:
        """Process the next token; true if it completes a statement."""
        kind = token[0]
        if self._resume is not None:
            if kind not in self._resume:
                if kind != "END":
                    return False
                self._recover_at_start()
            self._resume = None
        rows, states, tables = self._rows, self._states, self._tables
        passing, passed = tables.passing, tables.passed
        while (act := rows[states[-1]].get(kind)) is not None:
            if act < 0:
                if passing[~act] is None:
                    self._reduce(act)
                    continue
                # The symbol passes about twenty levels of precedence unchanged, on the same path each time.
                way = states[-2], states[-1], kind
                end = passed.get(way)
                states[-1] = tables.pass_on(way) if end is None else end
                continue
            states.append(act)
            self._shifted = act
            self._values.append(token)
            self._spans.append(token[2])
            if self._quiet:
                self._quiet -= 1
            if kind in CHECKED:
                self._doubtful = True
            if act in tables.final:
                self._accept()
                return True
            return False
        return self._handle_error(token)

    def _reduce(self, act: int) -> None:
        origin, size, kept, action = self._plans[~act]
        states, values, spans = self._states, self._values, self._spans
        if size == 1:
            if action is not None:
                values[-1] = action(spans[-1]) if kept == () else action(spans[-1], values[-1])
        elif size == 0:
            end = spans[-1] if spans else Span(1, 1, 1, 1)
            span = Span(end.end_line, end.end_column, end.end_line, end.end_column)
            assert action is not None
            values.append(action(span))
            spans.append(span)
            states.append(0)
        else:
            line, column, _, _ = spans[-size]
            _, _, end_line, end_column = spans[-1]
            span = _new(Span, (line, column, end_line, end_column))
            kids = values[-size:]
            if kept is not None:
                kids = [kids[place] for place in kept]
            del values[1 - size :], spans[1 - size :], states[1 - size :]
            values[-1] = kids[0] if action is None else action(span, *kids)
            spans[-1] = span
        states[-1] = self._rows[states[-2]][origin]

    def _accept(self) -> None:
        while (act := self._rows[self._states[-1]].get(_ACCEPT)) is not None:
            self._reduce(act)

    # ------------------------------------------------------------ errors

    def problem(self, message: str, span: Span) -> None:
        """Report a syntax error."""
        self.problems.append(Problem(message, span))

    def _retry_as_keyword(self, kind: str) -> bool:
        """Whether the last word, which was read as a name, is a keyword because a name follows it.

        The states before it stay valid: a statement may begin with a name as well as with such a keyword.
        """
        last = self._values[-1] if kind == "NAME" and self._values else None
        if not isinstance(last, ast.Call) or last.target is not None or last.args is not None:
            return False
        act = self._rows[self._states[-2]].get(last.name) if last.name in CONTEXTUAL else None
        if act is None or act < 0:
            return False
        self._states[-1] = self._shifted = act
        self._values[-1] = Token(last.name, last.name, last.span)
        return True

    def _handle_error(self, token: Token) -> bool:
        if self._retry_as_keyword(token.kind):
            return self.push(token)
        if token.kind == "NAME" and token.value in CONTEXTUAL_INSIDE and token.text in self._rows[self._states[-1]]:
            return self.push(Token(token.text, token.value, token.span))
        if not self._quiet:
            self.problem(f"{UNEXPECTED} {shown(token.kind)}{self._expected_list(token.kind)}", token.span)
        self._quiet = _QUIET
        self._reduce_without_token()
        while "ERROR" not in self._rows[self._states[-1]]:
            self._states.pop()
            self._values.pop()
            self._spans.pop()
        self._shift_error(token.span)
        return self.push(token)

    def _reduce_without_token(self) -> None:
        """Make all reductions that do not depend on the token, as yacc has done when it finds an error.

        Otherwise a block that is closed already would still count as open, and recovery would begin there.
        """
        known = len(self.problems)
        while True:
            row = self._rows[self._states[-1]]
            reductions = Counter(act for symbol, act in row.items() if act < 0 and symbol[0] != "@")
            if not reductions:
                break
            self._reduce(reductions.most_common(1)[0][0])
        # One error is enough: errors that these rules find in the text before it are not reported.
        del self.problems[known:]

    def _shift_error(self, span: Span) -> None:
        state = self._rows[self._states[-1]]["ERROR"]
        self._states.append(state)
        self._values.append(Token("ERROR", "", span))
        self._spans.append(span)
        self._resume = self._rows[state]

    def _recover_at_start(self) -> None:
        """The input ends inside a broken block or group: give up the whole statement."""
        span = self._spans[0]
        del self._states[1:], self._values[:], self._spans[:]
        self._shift_error(span)

    def _expected_list(self, kind: str) -> str:
        """The tokens that would have been accepted, if that list is short."""
        if kind in _CLOSERS and not self.idle and self.accepts("END"):
            return ', expecting end of command or "," or ;'
        if self._states[-1] != self._shifted and self._shifted not in self._tables.after_brace:
            # Rules were reduced for this token: an operator was possible, so the list is not short.
            return ""
        row = self._rows[self._states[-1]]
        # `assert` and `sync` are names for the grammar, not for the user.
        kinds = (kind for kind in row if not kind.startswith(("@", "$")) and kind not in _UNTOLD)
        expected = {kind for kind in kinds if self.accepts(kind)}
        if not 0 < len(expected) <= _MOST_EXPECTED or not expected <= set(_EXPECTED):
            return ""
        return ", expecting " + " or ".join(shown(kind) for kind in _EXPECTED if kind in expected)

    def accepts(self, kind: str) -> bool:
        """Whether a token of this kind could be shifted now; the stack is not touched."""
        depth, above = len(self._states), list[int]()
        while True:
            state = above[-1] if above else self._states[depth - 1]
            act = self._rows[state].get(kind)
            if act is None or act >= 0:
                return act is not None
            origin, size, _, _ = self._plans[~act]
            taken = min(size, len(above))
            if taken:
                del above[-taken:]
            depth -= size - taken
            state = above[-1] if above else self._states[depth - 1]
            above.append(self._rows[state][origin])
