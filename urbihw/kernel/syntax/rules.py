"""Finds the functions that make nodes, by the names that the grammar gives to its rules."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from urbihw.frozen import frozen
from urbihw.kernel.syntax.location import Span

Action = Callable[..., Any]
F = TypeVar("F", bound=Action)


@frozen
class Problem:
    """An error or a warning about a span of the statement; a warning does not prevent the statement from running."""

    message: str
    span: Span
    warning: bool = False


Problems = list[Problem]


class RuleSet:
    """The functions of one module by the names of their rules."""

    def __init__(self) -> None:
        self.makers: dict[str, Action] = {}
        """Functions of the span of the rule and the values of its symbols."""
        self.reporters: dict[str, Action] = {}
        """The same with a list of problems as the first argument, to which they add their errors."""

    def rule(self, make: F) -> F:
        """The decorator of a function that makes the value of the rule of its name."""
        self.makers[make.__name__] = make
        return make

    def reporting_rule(self, make: F) -> F:
        """The decorator of such a function that may report problems."""
        self.reporters[make.__name__] = make
        return make
