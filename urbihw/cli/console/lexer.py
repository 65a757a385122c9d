"""A lexer of urbiscript for Pygments.

The words of the language come from the parser's own table, so that exactly the keywords are coloured as such.
"""

from __future__ import annotations

from typing import Any, ClassVar

from pygments.lexer import RegexLexer, bygroups, words  # type: ignore[import-untyped]
from pygments.token import (  # type: ignore[import-untyped]
    Comment,
    Error,
    Keyword,
    Name,
    Number,
    Operator,
    Punctuation,
    String,
    Whitespace,
)

from urbihw.kernel.stages import UNITS, WORDS

DECLARING = ("class", "closure", "const", "function", "var")
CONSTANTS = ("false", "inf", "nan", "nil", "pi", "true", "void")
LIBRARY = ("Channel", "Date", "Dictionary", "Event", "Exception", "Float", "Global", "List", "Lobby", "Math", "Mutex",
           "Object", "Pair", "Path", "Process", "Regexp", "Semaphore", "String", "System", "Tag", "Timeout", "Tuple",
           "UObject", "UVar")
_UNIT = "|".join(sorted(UNITS, key=len, reverse=True))


class UrbiscriptLexer(RegexLexer):  # type: ignore[misc]
    """Lexer of urbiscript 2.3."""

    name = "urbiscript"
    aliases: ClassVar[list[str]] = ["urbiscript", "urbi"]
    filenames: ClassVar[list[str]] = ["*.u"]

    tokens: ClassVar[dict[str, list[Any]]] = {
        "root": [
            (r"\s+", Whitespace),
            (r"//.*?$", Comment.Single),
            (r"/\*", Comment.Multiline, "comment"),
            (r'"', String, "string"),
            (r"'(?:[^'\\\n]|\\.)*'", Name),
            (r"([A-Za-z_]\w*)(\s*)(:)(?![:=])", bygroups(Name.Label, Whitespace, Punctuation)),
            (words(DECLARING, suffix=r"\b"), Keyword.Declaration),
            (words(tuple(WORDS), suffix=r"\b"), Keyword),
            (words(CONSTANTS, suffix=r"\b"), Keyword.Constant),
            (words(LIBRARY, suffix=r"\b"), Name.Builtin),
            (r"[A-Za-z_]\w*(?=\s*\()", Name.Function),
            (r"[A-Za-z_]\w*", Name),
            (r"0x[0-9A-Fa-f]+", Number.Hex),
            (r"\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?:" + _UNIT + r")?(?!\w)", Number),
            (r"\d\w*", Error),
            (r"[;,|&](?![|&])", Punctuation),
            (r"[-+*/%^=!<>~?&|.]+", Operator),
            (r"[(){}\[\]:]", Punctuation),
        ],
        "comment": [
            (r"\*/", Comment.Multiline, "#pop"),
            (r"[^*]+|\*", Comment.Multiline),
        ],
        "string": [
            (r'"', String, "#pop"),
            (r"\\(?:x[0-9A-Fa-f]{2}|[0-7]{1,3}|.)", String.Escape),
            (r'[^"\\]+', String),
            (r"\\", Error),
        ],
    }
