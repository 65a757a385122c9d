"""A TextMate grammar, by which editors colour urbiscript; its words and units are those of the parser."""

from __future__ import annotations

import re
from typing import Any, Final

from urbihw.kernel.syntax.tokens import ANGLES, DURATIONS, IGNORED, KEYWORDS, SYNONYMS

SCOPE: Final = "source.urbiscript"
_DECLARING: Final = ("class", "closure", "const", "function", "var")
_CONSTANTS: Final = ("false", "inf", "nan", "nil", "pi", "true", "void")


def words() -> list[str]:
    """The words of the language."""
    return sorted({*KEYWORDS, *SYNONYMS, *IGNORED})


def grammar() -> dict[str, Any]:
    """The grammar, for a file ``urbiscript.tmLanguage.json``."""
    units = "|".join(sorted(map(re.escape, (*DURATIONS, *ANGLES)), key=len, reverse=True))
    named = [word for word in words() if word.isidentifier() and word not in (*_DECLARING, *_CONSTANTS)]
    patterns = [
        {"name": "comment.line.double-slash", "match": "//.*$"},
        {"name": "comment.block", "begin": r"/\*", "end": r"\*/"},
        {"name": "string.quoted.double", "begin": '"', "end": '"',
         "patterns": [{"name": "constant.character.escape", "match": r"\\(?:x[0-9A-Fa-f]{2}|[0-7]{1,3}|.)"}]},
        {"name": "variable.other", "match": r"'(?:[^'\\]|\\.)*'"},
        {"name": "entity.name.tag", "match": r"\b[A-Za-z_]\w*(?=\s*:(?![:=]))"},
        {"name": "storage.type", "match": rf"\b(?:{'|'.join(_DECLARING)})\b"},
        {"name": "constant.language", "match": rf"\b(?:{'|'.join(_CONSTANTS)})\b"},
        {"name": "keyword.control", "match": rf"\b(?:{'|'.join(map(re.escape, named))})\b"},
        {"name": "constant.numeric",
         "match": rf"\b(?:0x[0-9A-Fa-f]+|\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?:{units})?)(?!\w)"},
        {"name": "entity.name.function", "match": r"\b[A-Za-z_]\w*(?=\s*\()"},
        {"name": "keyword.operator", "match": r"[-+*/%^=!<>~?&|]+"},
    ]  # fmt: skip
    return {"name": "urbiscript", "scopeName": SCOPE, "fileTypes": ["u"], "patterns": patterns}
