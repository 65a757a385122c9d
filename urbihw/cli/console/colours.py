"""Highlighting of answers: each channel has its colour, values are coloured as urbiscript."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from prompt_toolkit.formatted_text import FormattedText, PygmentsTokens, to_formatted_text
from prompt_toolkit.styles import Style

from urbihw.cli.console.lexer import UrbiscriptLexer
from urbihw.client.lines import Line

CHANNELS: Final = {"error": "class:error", "warning": "class:warning", "output": "class:echo", "clog": "class:log"}
"""Channel -> style of its text; all other channels share one style."""

MAX_LEXED_BYTES: Final = 4000
"""Maximum length of a value that is coloured, in bytes; longer ones are data."""


STYLE: Final = Style.from_dict({
    # Only the terminal's own colours, which suit its background.
    "stamp": "ansibrightblack",
    "channel": "ansimagenta",
    "error": "ansired",
    "warning": "ansiyellow",
    "echo": "ansigreen",
    "log": "ansicyan",
    "other": "ansicyan",
    "note": "italic ansibrightblack",
    "prompt": "bold ansiblue",
    "prompt.lost": "bold ansired",
    "hint": "ansibrightblack",
    "bottom-toolbar": "noreverse ansibrightblack",
    "pygments.keyword": "bold ansiblue",
    "pygments.keyword.constant": "nobold ansimagenta",
    "pygments.literal.number": "ansicyan",
    "pygments.literal.string": "ansigreen",
    "pygments.literal.string.escape": "bold",
    "pygments.comment": "italic ansibrightblack",
    "pygments.name.builtin": "ansiblue",
    "pygments.name.label": "bold",
    "pygments.error": "underline",
})


def painted(line: Line) -> FormattedText:
    """The styled text of a line, with a line end; a Binary appears as its size."""
    text = _shown(line)
    if line.stamp is None:
        return FormattedText([(CHANNELS.get(line.channel, ""), f"{text}\n")])
    parts: list[tuple[str, str]] = [("class:stamp", f"[{line.stamp:08d}")]
    if line.channel:
        parts += [("class:stamp", ":"), ("class:channel", line.channel)]
    parts.append(("class:stamp", "] "))
    return FormattedText([*parts, *_body(line, text), ("", "\n")])


def _shown(line: Line) -> str:
    """The text, with the sizes of binaries instead of their data, and without control sequences of terminals."""
    raw = line.text
    for binary in line.binaries:
        size = str(len(binary.data)).encode()
        raw = raw.replace(b"\n" + binary.data, b" (" + size + b" bytes)", 1)
    text = raw.decode("utf-8", "replace")
    return "".join(character if character.isprintable() or character == "\t" else "�" for character in text)


def _body(line: Line, text: str) -> Iterable[tuple[str, str]]:
    if line.is_error:
        return [("class:warning" if line.channel == "warning" else "class:error", text)]
    if line.channel:
        return [(CHANNELS.get(line.channel, "class:other"), text)]
    if text.startswith("***"):
        return [("class:echo", text)]
    if len(text) > MAX_LEXED_BYTES:
        return [("", text)]
    return _tokens(text)


def _tokens(text: str) -> list[tuple[str, str]]:
    tokens = PygmentsTokens(list(UrbiscriptLexer(ensurenl=False, stripnl=False).get_tokens(text)))
    return [(part[0], part[1]) for part in to_formatted_text(tokens)]


def highlighted(text: str, margin: str) -> list[tuple[str, str]]:
    """The styled input, with a line end; ``margin`` is put before each line but the first."""
    parts: list[tuple[str, str]] = []
    for style, piece in _tokens(text):
        first, *rest = piece.split("\n")
        parts.append((style, first))
        for line in rest:
            parts += [("", f"\n{margin}"), (style, line)]
    return [*parts, ("", "\n")]
