"""Random programs for the fuzzer, as strategies of hypothesis.

    grammar()    sentences of urbihw/kernel/syntax/urbiscript.lark: whatever the grammar has is tried by itself
    calls()      calls of slots that the library has, on values of it: at once, in the background, under tags ...
    damaged()    one of these with some characters changed

Left out is what leaves the process (``OUTSIDE``): the hostile list tries that.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from hypothesis import strategies as st
from hypothesis.strategies import DrawFn, SearchStrategy
from lark.grammar import NonTerminal, Terminal
from lark.load_grammar import load_grammar

from urbihw.kernel import Kernel
from urbihw.kernel.syntax.tables import GRAMMAR
from urbihw.robot import ROBOT_LIBRARY

OUTSIDE = frozenset((
    "system", "File", "Directory", "OutputStream", "InputStream", "Path", "Process", "Socket", "Server", "IoService",
    "load", "loadFile",
))  # fmt: skip
"""Names that are not said: files, programs and networks."""

VALUES = (
    "nil", "void", "true", "false", "0", "1", "-1", "1.5", "1e17", "nan", "inf", '""', '"x"', '"%s%d["', "[]", "[1, 2]",
    '["k" => 1]', "(1, 2)", "function () { 1 }", "function (x) { x }", "closure (a, b) { a }", "Object.new",
    "Event.new", 'Tag.new("t")', "Date.epoch", 'Exception.new("x")', 'Channel.new("c")', "Mutex.new",
    "Semaphore.new(1)",
    "Barrier.new",
    'Regexp.new("a(b)?")', "Group.new(1, 2)", "Timeout.new(1)", "Duration.new(1)", "UObject.new", "WeakPointer.new",
    "PubSub.new", "Pair.new(1, 2)", "System.jobs", "Lobby.create", "Singleton.new", 'Formatter.new("a %s")',
    "Pattern.new([1])", "UVar.new(Object.new, \"v\")",
)  # fmt: skip
"""What calls are made on, and what they are given."""

KEPT = ("x", "y", "z", "f", "e", "t", "Global.g")
"""Variables of the programs."""

MODIFIERS = ("time", "speed", "sin", "cos", "ampli", "phase", "smooth", "accel", "timelimit")


# ---------------------------------------------------------------- what the library has


@cache
def library() -> dict[str, tuple[str, ...]]:
    """Classes by their names in Global, and their own slots."""
    world: Any = Kernel(fast=True, libraries=(ROBOT_LIBRARY,)).world
    found = {}
    for name, value in world.global_.slots.items():
        slots = getattr(world.peek_obj(value), "slots", None)
        if name not in OUTSIDE and name[:1].isupper() and slots:
            found[name] = tuple(sorted(slot for slot in slots if slot not in OUTSIDE))
    return found


@cache
def slots() -> tuple[str, ...]:
    """All slots of the library; such as are no identifiers are quoted."""
    names = sorted({slot for own in library().values() for slot in own})
    return tuple(name if name.isidentifier() else f"'{name}'" for name in names if "'" not in name)


# ---------------------------------------------------------------- sentences of the grammar

LEAST = 10**6


class Sentences:
    """The rules of the grammar, and for each symbol the least number of tokens that it takes."""

    def __init__(self) -> None:
        load: Any = load_grammar
        grammar, _ = load(GRAMMAR.read_text("utf-8"), GRAMMAR.name, [], False)
        terminals, rules, _ = grammar.compile(["start"], "*")
        texts = {terminal.name: terminal.pattern.value for terminal in terminals}
        self.rules: dict[str, list[tuple[Any, ...]]] = {}
        for rule in rules:
            self.rules.setdefault(str(rule.origin.name), []).append(tuple(rule.expansion))
        # What may be written to is known only when it is read: most of what the grammar lets through is refused.
        target = NonTerminal("target")
        for name in ("assignment", "assign_operator", "step_operator", "property"):
            self.rules[name] = [
                (target, *way[1:]) if way[0].name == "postfix" and len(way) > 1 else way for way in self.rules[name]
            ]
        self.rules["target"] = [(Terminal("NAME"),), *(way for way in self.rules["postfix"] if len(way) > 2)]
        self.tokens: dict[str, SearchStrategy[str]] = {name: st.just(text) for name, text in texts.items()}
        self.tokens |= {
            "NAME": st.sampled_from((*KEPT[:-1] * 20, *library(), *slots(), *MODIFIERS)),
            "FLOAT": st.sampled_from(("0", "1", "2.5", "1e300", "0x1f", "90deg")),
            "TIME": st.sampled_from(("0s", "1ms", "1s", "1h")),
            "STRING": st.sampled_from(('""', '"x"', '"%s"', '"\\0\\xff"', '"\\B(3)(abc)"')),
            "BINARY": st.sampled_from(("BIN 3;abc", "BIN 2 jpeg 1 2;ab")),
            "END": st.just(";"),
            "ERROR": st.sampled_from(("@", "1 1", "]", "else", "=> =>")),
        }
        self.least: dict[str, int] = dict.fromkeys(self.tokens, 1)
        while True:
            before = dict(self.least)
            for name, ways in self.rules.items():
                self.least[name] = min(self.least.get(name, LEAST), *(self.size(way) for way in ways))
            if self.least == before:
                break

    def size(self, way: tuple[Any, ...]) -> int:
        """The least number of tokens of an expansion."""
        return sum(self.least.get(symbol.name, LEAST) for symbol in way)

    def put(self, draw: DrawFn, symbol: Any, budget: int, into: list[str]) -> None:
        """Add a sentence for a symbol, of about so many tokens or of as few as it takes."""
        if isinstance(symbol, Terminal):
            into.append(draw(self.tokens[symbol.name]))
            return
        ways = [way for way in self.rules[symbol.name] if self.size(way) <= max(budget, self.least[symbol.name])]
        ways.sort(key=self.size)
        alone = [way for way in ways if len(way) == 1 and not isinstance(way[0], Terminal)]
        # A level of precedence mostly passes on, or all would be operators.
        if 0 < len(alone) < len(ways) and draw(st.integers(0, _PASSES.get(symbol.name, 8))) > 0:
            ways = alone
        way = draw(st.sampled_from(ways))
        spare = budget - self.size(way)
        for place, part in enumerate(way):
            more = draw(st.integers(0, max(0, spare))) if place + 1 < len(way) else max(0, spare)
            size = len(into)
            self.put(draw, part, self.least[part.name] + more, into)
            spare -= max(0, len(into) - size - self.least[part.name])


_PASSES = {"statement": 1, "postfix": 2, "open_unary": 4, "assignment": 3, "expression": 1}
"""How often a rule passes on instead of making something of its own, as a number of times to one; 8 for others."""
PLACES = ("{};", "{},", "function f(z) {{ for (2) {{ {} }} }}; f(1);", "try {{ {} }} catch (var z) {{ z; throw }};",
          "t: {{ {} }},", "at (x) {{ {} }}; var x = 1;")


@cache
def _sentences() -> Sentences:
    return Sentences()


@st.composite
def grammar(draw: DrawFn) -> str:
    """Some sentences of the grammar; many may only stand in a function or a loop."""
    made = _sentences()
    texts = []
    for _ in range(draw(st.integers(1, 4))):
        parts: list[str] = []
        made.put(draw, NonTerminal("command"), draw(st.integers(5, 60)), parts)
        texts.append(draw(st.sampled_from(PLACES)).format(" ".join(parts)))
    return "\n".join(texts)


# ---------------------------------------------------------------- calls of what there is


@st.composite
def _value(draw: DrawFn, depth: int = 2) -> str:
    kind = draw(st.integers(0, 5))
    if kind <= 1 or depth == 0:
        return draw(st.sampled_from(VALUES))
    if kind == 2:
        return draw(st.sampled_from(KEPT))
    if kind == 3:
        return draw(st.sampled_from(tuple(library())))
    return draw(_call(depth - 1))


@st.composite
def _call(draw: DrawFn, depth: int = 2) -> str:
    if draw(st.booleans()):
        name, own = draw(st.sampled_from(tuple(library().items())))
        slot = draw(st.sampled_from(own)) if own else "asString"
        this = name
    else:
        this, slot = draw(_value(depth)), draw(st.sampled_from(slots()))
    slot = slot if slot.isidentifier() or slot.startswith("'") else f"'{slot}'"
    arguments = draw(st.lists(_value(depth), max_size=3))
    return f"({this}).{slot}" + (f"({', '.join(arguments)})" if arguments else "")


FORMS: tuple[str, ...] = (
    "{0};", "{0},", "var x = {0}|;", "var y = {0}|;", "var Global.g = {0}|;", "function f(z) {{ {0}; {1} }}|;",
    "f({0});", "x = {0};", "echo({0});", "t: {0},", "var t = Tag.new|;", "t.stop;", "t.freeze;", "t.block({0});",
    "t.unblock;",
    "var e = Event.new|;", "at (e?(var z)) {{ {0} }};", "e!({0});", "at ({0}) {{ {1} }} onleave {{ {2} }};",
    "whenever ({0}) {{ {1} }};", "every (100ms) {{ {0} }},", "waituntil ({0}),", "{0} | {1};", "{0} & {1};",
    "for (var z : {0}) {{ {1} }};", "for| (3) {{ {0} }};", "if ({0}) {{ {1} }} else {{ {2} }};", "loop {{ {0} }},",
    "while ({0}) {{ {1}; break }};", "try {{ {0} }} catch (var z) {{ {1} }} finally {{ {2} }};", "throw {0};",
    "timeout (1s) {{ {0} }};", "stopif ({0}) {{ {1} }};", "freezeif ({0}) {{ {1} }},", "detach({{ {0} }});",
    "switch ({0}) {{ case {1}: {2}; default: 1 }};", "assert ({0});", "sleep(10ms);", "{0} == {1};", "{0} + {1};",
    "{0} < {1};", "{0}[{1}];", "{0}[{1}] = {2};", "[{0}, {1}];", "!{0};", "-{0};", "{0}.x = {1};",
    "{0}.removeSlot(\"x\");",
    "class A : {0} {{ var z = {1} }};", "do ({0}) {{ {1} }};",
    "x.setProperty(\"y\", \"rangemax\", {0});", "x->y = {0};",
    "x = 1 time: {0};", "x = 0 sin: {0} ampli: {1},", "{0}.protos = {1};", "{0}.addProto({1});", "eval({0});",
    "function {3}.{4}(z) {{ {0} }};", "{3}.{4} = {0};", "{3}.removeSlot(\"{4}\");", "{3}.protos = [{0}];", "lobby.{4};",
)  # fmt: skip
"""Statements; numbers stand for values, then for a class and for a name of a slot."""


@st.composite
def calls(draw: DrawFn) -> str:
    """Some statements with values and slots that exist."""
    lines = []
    for _ in range(draw(st.integers(1, 8))):
        form = draw(st.sampled_from(FORMS))
        values = [draw(_value()) if f"{{{place}}}" in form else "" for place in range(3)]
        thing = draw(st.sampled_from(tuple(library()))) if "{3}" in form else ""
        slot = draw(st.sampled_from(slots())) if "{4}" in form else ""
        lines.append(form.format(*values, thing, slot))
    return "\n".join(lines)


@st.composite
def damaged(draw: DrawFn) -> str:
    """A program with some characters lost, doubled or put in."""
    text = draw(st.one_of(grammar(), calls()))
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, len(text)))
        end = draw(st.integers(at, min(len(text), at + 5)))
        text = text[:at] + draw(st.text("\0\n\\\"'()[]{}|&;,~!?\xff0aB", max_size=3)) + text[end:]
    return text


def programs() -> SearchStrategy[str]:
    """All of these."""
    made: list[Callable[[], SearchStrategy[str]]] = [calls, grammar, damaged]
    return st.one_of([make() for make in made])
