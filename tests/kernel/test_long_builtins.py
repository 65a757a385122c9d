"""Built-in functions that are given much: others are answered meanwhile, and no job sees a thing half done."""

from __future__ import annotations

import gc
import random
import re
import time
from collections.abc import Iterator

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.runtime.code import Primitive
from urbihw.kernel.stdlib import searching, slices

HELD = 0.1
"""Seconds of processor that nothing may take in one go.  What is meant is less than half of it; this is a test that
must not fail on a machine that is slow or busy."""
MANY = 200_000
LONG = 3_000_000


@pytest.fixture(scope="module")
def kernel() -> Iterator[Kernel]:
    made = Kernel()
    made.run()
    world, slots = made.world, made.world.global_.slots
    mixed = list(range(MANY))
    random.Random(1).shuffle(mixed)
    slots["numbers"] = world.new_list([float(number) for number in mixed])
    slots["words"] = world.new_list([world.string(str(number)) for number in mixed])
    slots["image"] = world.new_list([world.new_list([float(x) for x in range(400)]) for _ in range(400)])
    slots["table"] = world.dictionary({str(number): float(number) for number in mixed})
    slots["text"] = world.string("abcdefgh, " * (LONG // 10))
    slots["spaces"] = world.string(" " * (LONG // 10))
    slots["digits"] = world.string("1" * LONG + "x")
    slots["kept"] = world.nil  # giving back the memory of so many objects takes Python a while
    slots["raw"] = world.string("\xff" * LONG)
    gc.freeze()
    yield made
    gc.unfreeze()
    made.close()


def lines(lobby: Lobby) -> list[str]:
    """What a lobby was told, without time stamps."""
    return [line[:1] + line[9:] for line in lobby.output.take_bytes().decode("latin-1").splitlines()]


def play(kernel: Kernel, text: str) -> tuple[list[str], float, int]:
    """Send a text; what was answered, the longest run of the scheduler in seconds of processor, and their number."""
    lobby = kernel.open_lobby()
    lines(lobby)
    lobby.feed(text.encode("latin-1") + b'\n;echo("done");')
    said: list[str] = []
    longest, runs = 0.0, 0
    until = time.monotonic() + 60
    while "[] *** done" not in said and time.monotonic() < until:
        began = time.thread_time()
        kernel.run()
        longest, runs = max(longest, time.thread_time() - began), runs + 1
        said += lines(lobby)
    lobby.close()
    kernel.run()
    return said[:-1], longest, runs


GIVES_WAY: dict[str, dict[str, tuple[str, str | None]]] = {
    "String": {
        "split": ('text.split(",").size', "[] 300001"),
        "split at spaces": ("spaces.split.size", "[] 0"),
        "split at several": ('text.split(["h,", "gh", "zz"], -1, true).size', "[] 600001"),
        "split at what is long": ("text.split(text).size", "[] 2"),
        "split into characters": ('spaces.split("").size', "[] 300000"),
        "join": ('",".join(words).size', "[] 1288889"),
        "replace": ('text.replace("abcdefgh,", "1").size', "[] 600000"),
        "replace with more": ('text.replace("a", "123").size', "[] 3600000"),
        "asPrintable": ("raw.asPrintable.size", "[] 12000002"),
        "isPrint": ("text.isPrint", "[] true"),
        "isAlpha": ("(text + 1).isPrint", "[] true"),
        "asFloat": ("try { digits.asFloat } catch (var e) { e.message.size }", "[] 93"),
        "distance": ('("ab" * 500).distance("ba" * 500)', "[] 2"),
        "distance of what is long": (
            "try { text.distance(text) } catch (var e) { e.message }",
            '[] "too long: expected strings of at most 10000 characters"',
        ),
        "closest": ('"1999".closest(words)', None),
        "%": ('(("%%" * 1000000) % []).size', "[] 1000000"),
        "% of many": ('(("%s" * 30000) % words.range(0, 30000)).size', None),
        "all": ("spaces.all(closure (c) { true })", "[] true"),
    },
    "List": {
        "asString": ("numbers.asString.size", "[] 1488890"),
        "asString of lists of lists": ("image.asString.size", None),
        "keys": ("numbers.keys.size", "[] 200000"),
        "has": ("words.has(nil)", "[] false"),
        "hasNot": ("words.hasNot(nil)", "[] true"),
        "hasSame": ("numbers.hasSame(nil)", "[] false"),
        "subset": ("[nil].subset(words)", "[] false"),
        "range": ("numbers.range(1, 200000).size", "[] 199999"),
        "sort": ("numbers.sort.range(0, 3)", "[] [0, 1, 2]"),
        "sort of strings": ("words.sort.range(0, 3)", '[] ["0", "1", "10"]'),
        "sort by a function": ("numbers.range(0, 30000).sort(closure (a, b) { b < a }).size", "[] 30000"),
        "max": ("numbers.max", "[] 199999"),
        "min": ("words.min", '[] "0"'),
        "argMax": ("numbers[numbers.argMax]", "[] 199999"),
        "argMin": ("numbers[numbers.argMin]", "[] 0"),
        "<": ("numbers < (numbers + [1])", "[] true"),
        "==": ("words == (words + [])", "[] true"),
        "!=": ("image != image", "[] false"),
        "eachi": ("numbers.eachi(closure (m, i) { i })", None),
        "map": ("numbers.map(closure (m) { m + 1 }).size", "[] 200000"),
        "filter": ("numbers.filter(closure (m) { m < 10 }).size", "[] 10"),
        "all": ("numbers.all(closure (m) { true })", "[] true"),
        "any": ("numbers.any(closure (m) { false })", "[] false"),
        "foldl": ("numbers.foldl(closure (a, m) { a + m }, 0)", "[] 19999900000"),
        "zip": ("numbers.zip(closure (a, b) { a }, words).size", "[] 200000"),
        "remove": ('words.clone.remove("7").size', "[] 199999"),
        "removeById": ("words.clone.removeById(words[0]).size", "[] 199999"),
        "-": ("(words - [nil, words[0]]).size", "[] 199999"),
    },
    "Tuple": {
        "asString": ("Tuple.new(numbers).asString.size", "[] 1488890"),
        "==": ("Tuple.new(words) == Tuple.new(words)", "[] true"),
        "<": ("Tuple.new(words) < Tuple.new(words)", "[] false"),
        "*": ("(Tuple.new(numbers) * 2).size", "[] 200000"),
        "+": ("(Tuple.new(numbers) + Tuple.new(numbers)).size", "[] 200000"),
    },
    "Dictionary": {
        "keys": ("table.keys.size", "[] 200000"),
        "asList": ("(kept = table.asList).size", "[] 200000"),
        "asString": ("table.asString.size", None),
        "==": ("table == table.clone", "[] true"),
        "!=": ("table != table.clone", "[] false"),
    },
    "Float": {
        "seq": ("1000000.seq.size", "[] 1000000"),
        "map": ("200000.map(closure (n) { n }).size", "[] 200000"),
    },
}
"""What takes long: what is asked, and the answer (None: any but an error).  The first word is the built-in function."""

QUICK = {
    "String": "!= * + += < <= == > >= [] []= asBool asString empty format fresh fromAscii length size toAscii toLower"
    " toUpper isAlnum isCntrl isDigit isGraph isLower isPunct isSpace isUpper isXdigit",
    "List": "+ += * << [] []= append asBool asList asPrintable back clear each each& each| empty front head insert"
    " insertBack insertFront join matchAgainst removeBack removeFront reverse size tail",
    "Tuple": "!= [] []= asPrintable init matchAgainst size",
    "Dictionary": "[] []= asBool asPrintable clear empty erase get getWithDefault has hasNot init matchAgainst"
    " set size",
}
"""What is over at once, is C's work on bytes or pointers, gives way by ``each``, or is the same as one above.

``each|`` holds the interpreter as ``for|`` does: it was asked to, and the bound on that ends it."""


@pytest.mark.parametrize("name", QUICK)
def test_every_built_in_function_is_known_to_give_way_or_to_be_quick(kernel: Kernel, name: str) -> None:
    world = kernel.world
    proto = {"String": world.string_proto}.get(name) or world.classes.get(name) or world.global_.slots[name]
    built_in = {slot for slot, value in proto.slots.items() if isinstance(value, Primitive)}
    known = {*QUICK[name].split(), *(row.split()[0] for row in GIVES_WAY[name])}
    assert built_in - known == set()


@pytest.mark.parametrize(
    ("text", "answer"),
    [pytest.param(*row, id=f"{name} {asked}") for name, rows in GIVES_WAY.items() for asked, row in rows.items()],
)
def test_others_are_answered_meanwhile(kernel: Kernel, text: str, answer: str | None) -> None:
    said, longest, _ = play(kernel, text)
    assert said == [answer] if answer is not None else not any("!!!" in line for line in said)
    assert longest < HELD


def test_what_is_usual_is_done_in_one_go(kernel: Kernel, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(slices, "TIME_SLICE_S", -1.0)
    lobby = kernel.open_lobby()
    lines(lobby)
    lobby.feed(b"var Global.turns = 0|; every (0) { turns += 1 },")
    text = "var n = turns| var l = numbers.range(0, 400)| l.sort | l.map(closure (m) { m }) | l.asString | l == l |" \
        ' text[0, 20000].split(",") | text[0, 20000].replace("a", "b") | turns - n;'
    said, _, _ = play(kernel, text)
    lobby.close()
    assert said == ["[] 0"]


# ---------------------------------------------------------------- no job sees a thing half done


@pytest.fixture
def busy(kernel: Kernel, monkeypatch: pytest.MonkeyPatch) -> Kernel:
    """A kernel in which what takes long gives way at each slice."""
    monkeypatch.setattr(slices, "TIME_SLICE_S", -1.0)
    return kernel


def test_a_list_that_others_change_meanwhile_is_sorted_as_it_was(busy: Kernel) -> None:
    said, _, _ = play(busy, "var l = numbers.clone|; { var s = l.sort| echo(s.size) | echo(s[9]) } & { l.clear };")
    assert said[:2] == ["[] *** 200000", "[] *** 9"]


def test_what_others_add_while_members_are_removed_stays(busy: Kernel) -> None:
    said, _, _ = play(busy, 'var l = words.clone|; { l.remove("5") | echo(l.back) } & { l << "new" }; l.size;')
    assert said[0] == '[] *** new' and said[-1] == "[] 200000"


def test_a_condition_that_takes_long_depends_on_what_it_read_only(busy: Kernel) -> None:
    said, _, _ = play(
        busy,
        'var l = numbers.clone|; var other = 0|; function look() { echo("looks") | true }|;\n'
        '{ at (look && l.has(-1)) echo("yes") } & { for (5) { other; sleep(0) } }; echo("watches");\n'
        "other = 2|; l << -1|; sleep(0);",
    )
    assert said == ["[] *** looks", "[] *** watches", "[] *** looks", "[] *** yes"]


# ---------------------------------------------------------------- the same as in one go


def test_a_sort_in_slices_is_pythons_sort(busy: Kernel, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(slices, "give_way", lambda world: None)
    monkeypatch.setattr(slices, "SORT_RUN_SIZE", 64)
    monkeypatch.setattr(slices, "CHECK_INTERVAL", 8)
    chance = random.Random(2)
    for size in (0, 1, 63, 64, 65, 128, 1000, 5000):
        for kinds in (1, 3, 50, 10**9):
            members = [(chance.randrange(kinds), place) for place in range(size)]
            found = slices.sort_in_slices(busy.world, members[:], lambda member: member[0])
            assert found == sorted(members, key=lambda member: member[0])
            plain = [member[0] for member in members]
            assert slices.sort_in_slices(busy.world, plain[:]) == sorted(plain)


def test_searching_in_slices_finds_what_python_finds(busy: Kernel, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(searching, "give_way", lambda world: None)
    monkeypatch.setattr(searching, "TEXT_SLICE_LENGTH", 7)
    chance = random.Random(3)
    for _ in range(2000):
        text = "".join(chance.choices("ab,", k=chance.randrange(60)))
        one = "".join(chance.choices("ab,", k=chance.randrange(1, 6)))
        assert searching.replaced(busy.world, text, one, "XY") == text.replace(one, "XY")
        spans = list(searching.found_separators(busy.world, text, [one]))
        begins = [0, *(end for _, end in spans)]
        ends = [*(begin for begin, _ in spans), len(text)]
        assert [text[a:b] for a, b in zip(begins, ends, strict=True)] == text.split(one)
        many = ["".join(chance.choices("ab,", k=chance.randrange(1, 4))) for _ in range(3)]
        wanted = [match.span() for match in re.finditer("|".join(map(re.escape, many)), text)]
        assert list(searching.found_separators(busy.world, text, many)) == wanted


def test_many_jobs_are_listed_in_slices_and_those_that_end_meanwhile_are_left_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(slices, "TIME_SLICE_S", -1.0)
    monkeypatch.setattr(slices, "MAX_ATOMIC_MEMBERS", 5)
    monkeypatch.setattr(slices, "CHECK_INTERVAL", 1)
    kernel = Kernel(fast=True)
    lobby = kernel.open_lobby()
    said = kernel.run_text(
        lobby, "var t = Tag.new|; for (20) detach({ t: sleep(1h) }); detach({ sleep(0s) | t.stop }) | System.jobs.size;"
    )
    assert float(said.split()[-1]) < 20
