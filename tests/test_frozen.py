"""Frozen dataclasses: what those of Python's own library can do, they can do, too."""

from __future__ import annotations

import math
import pickle
import re
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import pytest

from urbihw.frozen import frozen

ROOT = Path(__file__).resolve().parents[1]


@frozen
class Mark:
    """Has a field that does not count, and one that is not shown."""

    name: str
    place: float = 0.0
    note: str = field(default="", compare=False)
    secret: str = field(default="", repr=False)


@frozen(slots=False)
class Single:
    """Has one field, and keeps what it computes."""

    value: float

    @cached_property
    def half(self) -> float:
        """Half of the value."""
        return self.value / 2


@frozen
class Empty:
    """Has no fields."""


@frozen
class Named(Mark):
    """Inherits fields, and prints itself."""

    nick: str = ""

    def __repr__(self) -> str:
        return self.nick


@frozen
class Caseless:
    """Compares by itself, and is hashed by its fields."""

    name: str

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Caseless) and self.name.lower() == other.name.lower()


@frozen(eq=False)
class Alone:
    """Is equal to itself only."""

    value: int


@dataclass(frozen=True, slots=True)
class Peer:
    """The peer of ``Mark``."""

    name: str
    place: float = 0.0
    note: str = field(default="", compare=False)
    secret: str = field(default="", repr=False)


def test_objects_are_equal_by_the_fields_that_count() -> None:
    given: list[tuple[Any, ...]] = [("a",), ("a", 1.0), ("a", 1.0, "x"), ("b",), ("a", math.nan), ("a", 0.0, "", "s")]
    for one in given:
        for other in given:
            assert (Mark(*one) == Mark(*other)) is (Peer(*one) == Peer(*other)), (one, other)
            assert len({Mark(*one), Mark(*other)}) == len({Peer(*one), Peer(*other)})
    assert Single(math.nan) != Single(2.0) and Single(math.nan) == Single(math.nan)
    assert Empty() == Empty() and hash(Empty()) == hash(Empty())
    pair: object = ("a", 0.0)
    assert Mark("a") != Named("a") and Mark("a") != pair
    assert Caseless("a") == Caseless("A") and hash(Caseless("a")) == hash(Caseless("a"))
    assert Alone(1) != Alone(1) and len({Alone(1), Alone(1)}) == 2


def test_they_show_their_fields_but_hidden_ones() -> None:
    assert repr(Mark("a", 1.5, "n", "s")) == repr(Peer("a", 1.5, "n", "s")).replace("Peer", "Mark")
    assert repr(Empty()) == "Empty()"
    assert repr(Named("a", nick="Al")) == "Al"


def test_they_are_dataclasses_with_slots() -> None:
    mark = Mark("a", 1.0)
    assert [each.name for each in fields(mark)] == ["name", "place", "note", "secret"]
    assert replace(mark, place=2.0) == Mark("a", 2.0)
    assert pickle.loads(pickle.dumps(mark)) == mark
    with pytest.raises(AttributeError):
        object.__setattr__(mark, "other", 1)
    match mark:
        case Mark(name, place):
            assert (name, place) == ("a", 1.0)
    assert Single(3.0).half == 1.5


def test_all_frozen_classes_of_the_product_are_made_so() -> None:
    """One that is made by ``dataclass`` costs a start three times as much."""
    places = [*(ROOT / "urbihw").rglob("*.py"), *(ROOT / "packages/nao/urbihw_nao").rglob("*.py")]
    dear = [path.name for path in places if re.search(r"^\s*@dataclass\(.*frozen=True", path.read_text(), re.M)]
    assert dear == []
