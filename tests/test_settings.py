"""Rules and tables of settings."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from urbihw import settings as s
from urbihw.frozen import frozen


@frozen(slots=False)
class Toy(s.SettingsTable):
    """A toy.

    Attributes:
        colour: of its lamp.
        size: in m.
        parts: their numbers.
    """

    colour: str = s.setting("red", s.choice("red", "green"))
    size: float = s.setting(0.5, s.number(0, 2, " m"), in_url=True)
    parts: tuple[int, ...] = s.setting((), s.wholes(1, 9, "[1, 2]"))
    extra: dict[str, Any] = s.setting({}, s.TABLE)

    def clashes(self) -> Iterator[s.Mistake]:
        if self.colour == "green" and self.size > 1:
            yield s.Mistake("size", "a green one is small")


RULES: dict[str, tuple[s.SettingRule, list[Any], list[Any]]] = {
    "text": (s.TEXT, ["", "x"], [1, True, ["x"], None]),
    "switch": (s.SWITCH, [True, False], [0, 1, "true"]),
    "texts": (s.TEXTS, [[], ["a"], ("a", "b")], ["a", [1], [["a"]]]),
    "table": (s.TABLE, [{}, {"a": 1}], [[], 1]),
    "number": (s.number(0, 2), [0, 2, 1.5], [-0.1, 2.1, True, "1", float("nan"), float("inf")]),
    "whole": (s.whole(0, 2), [0, 2], [1.0, 3, True, "1"]),
    "wholes": (s.wholes(1, 9, "[1]"), [[], [1, 9], (2,)], [[0], [10], [1.0], [True], 1, "1"]),
    "positive": (s.positive(), [0.1, 5], [0, -1, float("inf"), True]),
    "rising": (s.rising(2, "[0, 1]"), [[0, 1], [-1.5, 2]], [[1, 0], [1, 1], [0], [0, 1, 2], [0, "1"], [0, True], 1]),
    "choice": (s.choice(1, "auto"), [1, "auto"], [True, 1.0, "1", 2, []]),
    "any": (s.ANY, [1, 1.5, "x", True], [[], {}]),
}


@pytest.mark.parametrize("name", RULES)
def test_what_a_rule_accepts(name: str) -> None:
    rule, good, bad = RULES[name]
    assert [value for value in good if not rule.accepts(value)] == []
    assert [value for value in bad if rule.accepts(value)] == []


def test_a_table_from_what_is_given() -> None:
    made = Toy.of({"size": 1, "parts": [1, 2]})
    assert made == Toy("red", 1.0, (1, 2))
    assert type(made.size) is float
    assert Toy().extra is not Toy().extra
    assert Toy.in_url() == {"size"}


@pytest.mark.parametrize(
    ("given", "line"),
    [
        ({"color": "red"}, "options.color: no such option; did you mean colour?"),
        ({"xyz": 1}, "options.xyz: no such option; there are: colour, size, parts, extra"),
        ({"colour": "blue"}, 'options.colour: wants one of red, green, not "blue"'),
        ({"size": True}, "options.size: wants a number from 0 to 2 m, not true"),
        ({"parts": [1, 10]}, "options.parts: wants a list of whole numbers from 1 to 9, such as [1, 2], not [1, 10]"),
        ({"colour": "green", "size": 1.5}, "options.size: a green one is small"),
    ],
)
def test_a_mistake_is_one_line(given: dict[str, Any], line: str) -> None:
    with pytest.raises(s.BadSetting) as caught:
        Toy.of(given)
    assert str(caught.value) == line


def test_all_that_is_wrong_and_what_is_right() -> None:
    made, mistakes = Toy.read({"color": 1, "size": "big", "parts": [3]}, "option")
    assert made == Toy(parts=(3,))
    assert [each.key for each in mistakes] == ["color", "size"]


def test_texts_of_a_url_get_the_types_of_their_rules() -> None:
    rules = {"baud": s.whole(1, 9), "name": s.TEXT, "fast": s.SWITCH, "any": s.ANY, "share": s.number(0, 1)}
    texts = {"baud": "5", "name": "007", "fast": "True", "any": "0x1", "share": ".5"}
    assert s.from_texts(rules, texts, "parameter") == (
        {"baud": 5, "name": "007", "fast": True, "any": "0x1", "share": 0.5}, [],
    )  # fmt: skip
    (mistake,) = s.from_texts(rules, {"baud": "five"}, "parameter")[1]
    assert str(mistake) == 'baud: wants a whole number from 1 to 9, not "five"'


@pytest.mark.parametrize(
    ("known", "end"),
    [(("speed",), "; did you mean speed?"), (("torque",), "; there is: torque"), ((), "; there are: none")],
)
def test_the_end_of_a_message_about_an_unknown_name(known: tuple[str, ...], end: str) -> None:
    assert s.guess("sped", known) == end


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"rate": 16**5000}, "rate: wants a number from 1 to 1000, not a number of too many digits"),
        ({"a\nFORGED\x1b[2J": 1}, "a\\nFORGED\\x1b[2J: no such setting; there is: rate"),
        (
            {"rate": "x" * 100_000},
            'rate: wants a number from 1 to 1000, not "' + "x" * (s.MAX_LINE_LENGTH - 42) + "...",
        ),
    ],
)
def test_a_mistake_is_a_short_line_whatever_was_written(given: dict[str, Any], said: str) -> None:
    _, (mistake,) = s.checked({"rate": s.number(1, 1000)}, given, "setting")
    assert str(mistake) == said


def test_a_text_of_too_many_digits_is_no_number() -> None:
    _, (mistake,) = s.from_texts({"baud": s.whole(1, 10**7)}, {"baud": "9" * 5000}, "parameter")
    assert str(mistake).startswith("baud: wants a whole number from 1 to 10000000, not")
