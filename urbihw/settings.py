"""Tables of settings: the rule of each setting is the single source for the check, its messages and the JSON schema.

A table is a frozen dataclass that derives from ``SettingsTable``.  Its fields are made by ``setting``, and its
docstring explains them under "Attributes"::

    @frozen(slots=False)
    class Options(SettingsTable):
        \"\"\"The options of a toy.

        Attributes:
            colour: of its lamp.
        \"\"\"

        colour: str = setting("red", choice("red", "green"))

The settings of the daemon are one table, the options of a platform and the limits of a device are others.  The
parameters of a bus url are a dictionary of rules by name.
"""

from __future__ import annotations

import copy
import difflib
import ipaddress
import math
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import field, fields
from typing import Any, NamedTuple, Self

from urbihw.frozen import frozen


class BadSetting(ValueError):
    """An invalid setting; the message is one line with the name of the setting and its rule."""


class Mistake(NamedTuple):
    """The error of one setting: its name, and the rest of the message."""

    key: str
    text: str

    def __str__(self) -> str:
        return one_line(f"{self.key}: {self.text}")


MAX_LINE_LENGTH = 1000
"""Maximum length of a message in characters; a file may contain a name or a value of a million characters."""


def escape_unprintable(text: str) -> str:
    r"""A text that a terminal cannot take for a command, nor a reader for two lines: unprintable characters as ``\n``,
    ``\x1b``, ``\u202e``.
    """
    return text if text.isprintable() else "".join(sign if sign.isprintable() else ascii(sign)[1:-1] for sign in text)


def one_line(text: str) -> str:
    """A text for a terminal or a log: unprintable characters are escaped, and a long text is truncated."""
    return escape_unprintable(text if len(text) <= MAX_LINE_LENGTH else text[:MAX_LINE_LENGTH] + "...")


def is_address(host: str) -> bool:
    """Return whether a text is an address of IP, and no name."""
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True


@frozen(slots=False)
class SettingRule:
    """The rule that the value of a setting must fulfil.

    Attributes:
        kinds: the types of the value in TOML.
        wants: the rule in words.
        make: converts the value to the type that the program uses.
        least, most: bounds of a number, inclusive; None for none.
        above: an exclusive lower bound.
        words: the allowed values; () for any.
        each: the rule of the members of a list.
        length: required number of members of a list; None for any number.
        rising: the members must not fall, and the last must be above the first.
        pattern: a regular expression for the JSON schema, of texts that the table's own check accepts; "" for any.
    """

    kinds: tuple[type, ...]
    wants: str
    make: Callable[[Any], Any] = lambda value: value
    least: float | None = None
    most: float | None = None
    above: float | None = None
    words: tuple[Any, ...] = ()
    each: SettingRule | None = None
    length: int | None = None
    rising: bool = False
    pattern: str = ""

    def accepts(self, value: object) -> bool:
        """Whether a value fulfils the rule.  A TOML boolean is no number."""
        if not isinstance(value, self.kinds) or (isinstance(value, bool) and bool not in self.kinds):
            return False
        if self.words:
            return value in self.words
        if isinstance(value, str):
            return "\0" not in value  # no name of a file, host or device is like that
        if isinstance(value, int | float) and not isinstance(value, bool):
            return self._within(value)
        return not isinstance(value, list | tuple) or self._members(value)

    def _within(self, value: float) -> bool:
        return (
            (isinstance(value, int) or math.isfinite(value))
            and abs(value) < _GREATEST
            and (self.least is None or value >= self.least)
            and (self.most is None or value <= self.most)
            and (self.above is None or value > self.above)
        )

    def _members(self, value: list[Any] | tuple[Any, ...]) -> bool:
        if self.each is not None and not all(map(self.each.accepts, value)):
            return False
        if self.length is not None and len(value) != self.length:
            return False
        return not self.rising or (list(value) == sorted(value) and value[0] < value[-1])

    def schema(self) -> dict[str, Any]:
        """The rule as a JSON schema, which cannot express that a list must rise."""
        if self.words:
            return {"enum": list(self.words)}
        names = list(dict.fromkeys(_JSON[kind] for kind in self.kinds if kind in _JSON))
        if "number" in names:
            names = [name for name in names if name != "integer"]
        made: dict[str, Any] = {"type": names[0] if len(names) == 1 else names}
        bounds = {"minimum": self.least, "maximum": self.most, "exclusiveMinimum": self.above}
        made |= {name: bound for name, bound in bounds.items() if bound is not None}
        if self.each is not None:
            made["items"] = self.each.schema()
        if self.pattern:
            made["pattern"] = self.pattern
        if self.length is not None:
            made |= {"minItems": self.length, "maxItems": self.length}
        return made


_GREATEST = 1e18  # a greater whole number makes no sense in seconds, bytes or radians
_JSON = {str: "string", bool: "boolean", int: "integer", float: "number", list: "array", dict: "object"}

TEXT = SettingRule((str,), "a text")
SWITCH = SettingRule((bool,), "true or false")
TEXTS = SettingRule((list, tuple), "a list of texts", tuple, each=TEXT)
TABLE = SettingRule((dict,), "a table")
ANY = SettingRule((bool, int, float, str), "a value")


def number(least: float, most: float, unit: str = "") -> SettingRule:
    """A number within bounds; ``unit`` appears in the message and begins with a space."""
    return SettingRule((int, float), f"a number from {least:g} to {most:g}{unit}", float, least, most)


def positive() -> SettingRule:
    """A number above 0."""
    return SettingRule((int, float), "a number above 0", float, above=0)


def whole(least: int, most: int, unit: str = "") -> SettingRule:
    """A whole number within bounds."""
    return SettingRule((int,), f"a whole number from {least} to {most}{unit}", least=least, most=most)


def wholes(least: int, most: int, example: str) -> SettingRule:
    """A list of whole numbers within bounds."""
    return SettingRule(
        (list, tuple), f"a list of whole numbers from {least} to {most}, such as {example}", tuple,
        each=whole(least, most),
    )  # fmt: skip


def rising(length: int, example: str, least: float | None = None, most: float | None = None) -> SettingRule:
    """A list of ``length`` numbers, each no smaller than the one before, all within both bounds or any."""
    within = "" if least is None or most is None else f" from {least:g} to {most:g}"
    return SettingRule(
        (list, tuple), f"{length} rising numbers{within}, such as {example}", lambda value: tuple(map(float, value)),
        each=SettingRule((int, float), "a number", least=least, most=most), length=length, rising=True,
    )  # fmt: skip


def choice(*words: Any, wants: str = "", make: Callable[[Any], Any] = lambda value: value) -> SettingRule:
    """One of the given words or numbers."""
    kinds = tuple(dict.fromkeys(map(type, words)))
    listed = ", ".join(shown(word) if word == "" else str(word) for word in words)
    return SettingRule(kinds, wants or "one of " + listed, make, words=words)


def setting(default: Any, rule: SettingRule, *, in_url: bool = False, secret: bool = False, file: bool = False) -> Any:
    """A field of a table.

    ``in_url``: it can also be given in the robot's url, as ``?name=value``.  ``secret``: a password or the like, which
    neither ``repr`` nor ``urbihw config show`` shows.  ``file``: the path of a file, beside the settings file unless it
    says where.
    """
    about = {"rule": rule, "in_url": in_url, "secret": secret, "file": file}
    if isinstance(default, dict | list):
        return field(default_factory=lambda: copy.copy(default), metadata=about)
    return field(default=default, repr=not secret, metadata=about)


@frozen(slots=False)
class SettingsTable:
    """Base class of all tables of settings."""

    @classmethod
    def of(cls, given: Mapping[str, Any], place: str = "options", what: str = "option") -> Self:
        """A table with the given values and defaults for the rest.  Raises BadSetting for the first mistake."""
        made, mistakes = cls.read(given, what)
        if mistakes:
            raise BadSetting(f"{place}.{mistakes[0]}")
        return made

    @classmethod
    def read(cls, given: Mapping[str, Any], what: str) -> tuple[Self, list[Mistake]]:
        """A table with the valid ones of the given values, and the mistakes; ``what`` is the word for a row in
        messages."""
        values, mistakes = checked(cls.rules(), given, what)
        made = cls(**values)
        return made, [*mistakes, *made.clashes()]

    @classmethod
    def rules(cls) -> dict[str, SettingRule]:
        """The rule of each row, by name."""
        return {each.name: each.metadata["rule"] for each in fields(cls)}

    @classmethod
    def in_url(cls) -> frozenset[str]:
        """The rows that can also be given in the robot's url."""
        return frozenset(each.name for each in fields(cls) if each.metadata["in_url"])

    @classmethod
    def files(cls) -> frozenset[str]:
        """The rows that are paths of files."""
        return frozenset(each.name for each in fields(cls) if each.metadata["file"])

    @classmethod
    def secrets(cls) -> frozenset[str]:
        """The rows whose values are never shown."""
        return frozenset(each.name for each in fields(cls) if each.metadata["secret"])

    def clashes(self) -> Iterator[Mistake]:
        """The conflicts between rows that are valid by themselves."""
        return iter(())

    def unusable_files(self) -> Iterator[Mistake]:
        """The rows that name a file which is missing or wrong, in the words of the start; this opens the files."""
        return iter(())


def checked(
    rules: Mapping[str, SettingRule], given: Mapping[str, Any], what: str
) -> tuple[dict[str, Any], list[Mistake]]:
    """The valid ones of the given values, converted by their rules, and the mistakes in the others."""
    values: dict[str, Any] = {}
    mistakes = []
    for key, value in given.items():
        rule = rules.get(key)
        if rule is None:
            mistakes.append(Mistake(key, f"no such {what}{guess(key, rules)}"))
        elif rule.accepts(value):
            values[key] = rule.make(value)
        else:
            mistakes.append(Mistake(key, f"wants {rule.wants}, not {shown(value)}"))
    return values, mistakes


def from_texts(
    rules: Mapping[str, SettingRule], texts: Mapping[str, str], what: str
) -> tuple[dict[str, Any], list[Mistake]]:
    """The same for values that are texts, as those of a url are."""
    return checked(rules, {key: _meant(rules.get(key, TEXT), text) for key, text in texts.items()}, what)


def _meant(rule: SettingRule, text: str) -> Any:
    if bool in rule.kinds and text.lower() in ("true", "false"):
        return text.lower() == "true"
    if int in rule.kinds and re.fullmatch(r"-?[0-9]{1,18}", text):
        return int(text)
    if float in rule.kinds:
        try:
            return float(text)
        except ValueError:
            pass
    return text


def guess(name: str, known: Collection[str]) -> str:
    """The end of a message about an unknown name: a similar name, or the list of known names."""
    close = difflib.get_close_matches(name, known, 1)
    if close:
        return f"; did you mean {close[0]}?"
    return f"; there {'is' if len(known) == 1 else 'are'}: {', '.join(known) or 'none'}"


def shown(value: object) -> str:
    """A value in the syntax of TOML, on one line; for messages."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(shown, value))}]"
    if isinstance(value, int) and abs(value) > _GREATEST:
        return "a number of too many digits"  # Python refuses to write very long ones
    return "a table" if isinstance(value, dict) else str(value)
