"""Templates: statements that differ only in their literals are parsed and compiled once, since clients send data as
text.

``motor.getSlot("val").update_timed(5, 1000000)|;`` may arrive with other numbers a thousand times a second.  Its
*skeleton* is the text without the numbers and strings.  When a skeleton is seen for the second time, a statement with
placeholders for the literals is compiled, and the indexes of the placeholders among the constants of the generated code
are stored.  From then on, a statement of this skeleton is the same code with other constants.

Each placeholder must occur among the constants of the statement or of the functions in it, such as lazy arguments; this
excludes other uses of literals.  The code made from the template for the present statement must equal the compiler's
code.  Positions in errors and the syntax of lazy calls are those of the statement as it was sent, which is compiled
again when they are needed.

Clients know different names of lazy functions (``runtime.lazy_names``), so a template has a *form* for each set of
these names that a client knows and that occur in the skeleton.
"""

from __future__ import annotations

import dis
import math
import re
from collections.abc import Callable, Iterator
from functools import partial
from types import CodeType
from typing import TYPE_CHECKING, Any, Final, overload

from urbihw.kernel.compiler import CompiledUnit, compile_node
from urbihw.kernel.compiler.linemap import MappedPlace, have_bounced
from urbihw.kernel.compiler.unit import CompilerState, Syntax
from urbihw.kernel.syntax.ast import Node
from urbihw.kernel.syntax.reader import Statement, StatementCache, parse_program

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

Literal = float | str
Compile = Callable[[Node], CompiledUnit]
"""Compiles a statement for the present state of the kernel."""

MAX_TEMPLATES: Final = 512
"""Maximum number of cached statements, and of cached skeletons; so many long ones take 40 MB in one form each."""
MAX_SKELETON_LENGTH: Final = 300
"""Maximum length of a skeleton, in characters.  Making a template takes two compilations without a pause, 5 ms at most.
A list of nearly a hundred numbers has this length."""
MAX_FORMS: Final = 4
"""Maximum number of forms of a template; a new one replaces the oldest."""
MAX_TEMPLATE_TEXT: Final = 10_000
"""Maximum length of a statement that is split into skeleton and literals, in characters."""

_LITERAL = re.compile(r'"[^"\\\n]*"|(?<![\w.])\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w.])')
_OTHER = re.compile(r"[{}\\\n\"'`]|//|/\*|\bBIN\b")
"""The parts of a text that exclude templates: functions, escapes, comments, and binary data, whose numbers say where
the statement ends."""
_WORD = re.compile(r"\w+")
_NO_WORDS: Final[frozenset[str]] = frozenset()


def skeleton(text: str) -> tuple[str, list[str]] | None:
    """A text without its literals, and the literals; None if it has none, or if the text is too long or too complex."""
    literals = _LITERAL.findall(text) if len(text) <= MAX_TEMPLATE_TEXT else None
    if not literals:
        return None
    parts = _LITERAL.split(text)
    bones = "\0".join(parts)
    if len(bones) > MAX_SKELETON_LENGTH or _OTHER.search(bones) or len(parts) != len(literals) + 1:
        return None
    return bones + "\1" + "".join(["s" if literal[0] == '"' else "n" for literal in literals]), literals


def values_of(literals: list[str]) -> list[Literal] | None:
    """The values of the literals; None if a number is too large for a Float."""
    values: list[Literal] = [each[1:-1] if each[0] == '"' else float(each) for each in literals]
    return None if math.inf in values else values


class Template:
    """The template of one skeleton; ``usable``: its statements can share code."""

    def __init__(self, bones: str, known: Any, size: int) -> None:
        """``known`` is the reader's cache entry for one of its statements, ``size`` the length of that statement."""
        self.usable = True
        self._bones, _, self._kinds = bones.partition("\1")
        self._known = known._replace(node=None)
        self._size = size
        self._words = frozenset(_WORD.findall(self._bones))
        self._state: CompilerState | None = None
        self._forms: dict[frozenset[str], _Form] = {}
        """The forms for the present state, by the lazy names that only some clients know."""

    def known(self, use: TemplateUse, text: str) -> Any:
        """The reader's cache entry for another statement of the skeleton."""
        return self._known._replace(node=use, end_column=self._known.end_column + len(text) - self._size)

    def unit(self, world: World, text: str, values: list[Literal]) -> CompiledUnit:
        """The compiled statement for these values; ``text`` is the statement as it was sent."""
        names = world.lazy_names
        known, shared = names.known(), names.shared
        own = _NO_WORDS if known is shared else (self._words & known) - shared
        state = (shared, world.generic_floats)
        if state != self._state:
            self._state = state
            self._forms.clear()
        form = self._forms.get(own)
        if form is None:
            if len(self._forms) >= MAX_FORMS:
                del self._forms[next(iter(self._forms))]
            compile_ = partial(compile_node, lazy_names=shared | own, generic=world.generic_floats)
            form = self._forms[own] = _Form(self._bones, self._kinds, compile_, text, values)
            if not own:
                self.usable = form.usable
        return form.made(text, values)


class _Form:
    """The compiled template for one state of the compiler; ``usable``: it gave the code of its first statement."""

    def __init__(self, bones: str, kinds: str, compile_: Compile, text: str, values: list[Literal]) -> None:
        self._compile = compile_
        self._last: _Real | None = None
        """The statement that was made last, which is often made again: a loop evaluates it, a file loads itself."""
        stand_ins: list[Literal] = [
            f"stand-in {index}" if kind == "s" else 8.1e12 + index + 0.5 for index, kind in enumerate(kinds)
        ]
        literals = [f'"{each}"' if isinstance(each, str) else repr(each) for each in stand_ins] + [""]
        unit = compile_(_node("".join([x + y for x, y in zip(bones.split("\0"), literals, strict=True)])))
        self._code, self._places = unit.code, _Places(unit.code, stand_ins)
        self._bounced = have_bounced(unit.entries)
        self.usable = not unit.constants and not unit.pieces and self._places.all_literals() == set(range(len(kinds)))
        if self.usable:
            meant = self._compile(_node(text)).code
            self.usable = _instructions(self._places.filled(self._code, values)) == _instructions(meant)

    def made(self, text: str, values: list[Literal]) -> CompiledUnit:
        """The compiled statement for these values; ``text`` is the statement as it was sent."""
        if not self.usable:
            return self._compile(_node(text))
        if self._last is None or not self._last.is_of(text):
            self._last = _Real(text, self._compile)
        real = self._last
        code, entries = self._places.filled(self._code, values), _Entries(real, self._bounced)
        return CompiledUnit(code, entries, [], _Syntax(real), [])


class _Places:
    """Where the literals are among the constants of a code object and of the functions in it."""

    __slots__ = ("_inner", "_literals")

    def __init__(self, code: CodeType, stand_ins: list[Literal]) -> None:
        constants = code.co_consts
        self._literals = [
            (constants.index(each), literal) for literal, each in enumerate(stand_ins) if each in constants
        ]
        within = [(at, _Places(each, stand_ins)) for at, each in enumerate(constants) if isinstance(each, CodeType)]
        self._inner = [(at, places) for at, places in within if places.all_literals()]

    def all_literals(self) -> set[int]:
        """The indexes of the literals that have places."""
        return {literal for _, literal in self._literals}.union(*[each.all_literals() for _, each in self._inner])

    def filled(self, code: CodeType, values: list[Literal]) -> CodeType:
        """The code object with these values of the literals."""
        constants = list(code.co_consts)
        for at, literal in self._literals:
            constants[at] = values[literal]
        for at, places in self._inner:
            constants[at] = places.filled(constants[at], values)
        return code.replace(co_consts=tuple(constants))


def _node(text: str) -> Node:
    """The syntax of a statement that was parsed before."""
    (statement,) = parse_program(text)
    assert isinstance(statement, Statement)
    return statement.node


def _instructions(code: CodeType) -> list[tuple[str, Any, int | None]]:
    """The instructions of a code object and of the functions in it, independent of the order of the constants; the last
    item is the line, an index into the entries.
    """
    return [
        (
            each.opname,
            _instructions(each.argval) if isinstance(each.argval, CodeType) else each.argval,
            each.positions and each.positions.lineno,
        )
        for each in dis.get_instructions(code)
    ]


class _Real:
    """The statement as it was sent, compiled when it is needed."""

    __slots__ = ("_compile", "_text", "_unit")

    def __init__(self, text: str, compile_: Compile) -> None:
        self._text = text
        self._compile = compile_
        self._unit: CompiledUnit | None = None

    def is_of(self, text: str) -> bool:
        """Whether this is the statement of a text."""
        return self._text == text

    def get(self) -> CompiledUnit:
        """The compiled statement, made at its first use."""
        if self._unit is None:
            self._unit = self._compile(_node(self._text))
        return self._unit


class _Entries(list[MappedPlace]):
    """The places in the source, compiled when they are needed.  ``have_bounced`` is the same for all statements of a
    template."""

    __slots__ = ("_real", "have_bounced")

    def __init__(self, real: _Real, bounced: bool) -> None:
        super().__init__()
        self._real = real
        self.have_bounced = bounced

    def __len__(self) -> int:
        return len(self._real.get().entries)

    def __iter__(self) -> Iterator[MappedPlace]:
        return iter(self._real.get().entries)

    @overload  # type: ignore[override]
    def __getitem__(self, index: int) -> MappedPlace: ...

    @overload
    def __getitem__(self, index: slice) -> list[MappedPlace]: ...

    def __getitem__(self, index: int | slice) -> MappedPlace | list[MappedPlace]:
        return self._real.get().entries[index]


class _Syntax(Syntax):
    """The syntax of calls whose function is lazy, compiled when it is needed."""

    __slots__ = ("_real",)

    def __init__(self, real: _Real) -> None:
        super().__init__()
        self._real = real

    def __getitem__(self, index: int) -> Any:
        return _Arguments(self._real, index)

    @property
    def late(self) -> Any:
        """The ``LateSites`` of the unit."""
        return self._real.get().syntax.late


class _Arguments:
    """The syntax of the arguments of a call whose function is lazy, compiled when it is needed."""

    __slots__ = ("_index", "_real")

    def __init__(self, real: _Real, index: int) -> None:
        self._real = real
        self._index = index

    def __getitem__(self, argument: int) -> Any:
        return self._real.get().syntax[self._index][argument]


class TemplateUse(Node):
    """Replaces the syntax of a statement that was not parsed because its template is known."""

    __slots__ = ("template", "values")

    def __init__(self, template: Template, values: list[Literal]) -> None:
        super().__init__()
        self.template = template
        self.values = values


class TemplateCache(StatementCache):
    """The cache of parsed statements, with templates for statements that arrive with other literals each time."""

    def __init__(self, size: int = MAX_TEMPLATES) -> None:
        super().__init__(size)
        self._templates: dict[str, Template | None] = {}

    def get(self, text: str) -> Any:
        """The cache entry for a text, or None."""
        known = super().get(text)
        if known is None:
            use = self.use(text)
            return None if use is None else use.template.known(use, text)
        return known

    def put(self, text: str, known: Any) -> None:
        """Store a statement, or a template at the second statement of a skeleton."""
        found = skeleton(text) if known.lines == 0 else None
        if found is not None:
            bones = found[0]
            if bones not in self._templates:
                if len(self._templates) >= self.size:
                    del self._templates[next(iter(self._templates))]
                self._templates[bones] = None
            else:
                template = self._templates[bones]
                if template is None:
                    template = self._templates[bones] = Template(bones, known, len(text))
                if template.usable:
                    return
        super().put(text, known)

    def use(self, text: str) -> TemplateUse | None:
        """The template of a text, with the values of its literals; None if there is none."""
        found = skeleton(text)
        if found is None:
            return None
        bones, literals = found
        template = self._templates.get(bones)
        values = None if template is None or not template.usable else values_of(literals)
        if template is None or values is None:
            return None
        self._templates[bones] = self._templates.pop(bones)
        return TemplateUse(template, values)
