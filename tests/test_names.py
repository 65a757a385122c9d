"""What the names of classes, and the sentences about them, must be like."""

from __future__ import annotations

import re
from collections import defaultdict
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[1]
TEXTS: Final = re.compile(r'""".*?"""', re.DOTALL)
CLASSES: Final = re.compile(r"^\s*class (\w+)", re.MULTILINE)

ALLOWED: Final[frozenset[str]] = frozenset()
"""Names that two classes must share, each with the outside contract that wants it.  There is none."""


PROSE: Final = (
    "urbihw/**/*.py", "urbihw/**/*.u", "urbihw/**/*.js", "urbihw/platforms/*/README.md", "fakes/**/*.py",
    "packages/**/*.py", "packages/**/*.u", "packages/**/*.md", "docs/*.md",
    "docs/news/*", "*.md",
)  # fmt: skip
WORDS: Final = ("Of ", "of before", "of now", "none", "told", "hoever", "obody")
"""One of them is in each line that ``ACCENT`` matches: to look for them first is quicker by far."""
ACCENT: Final = re.compile(
    r"(?:^|[.:;!?]\s+|\"\"\"|#\s|^\s*[-*]\s)Of (?!course\b)|\bof (?:before|now)\b"
    r"|(?<![Tt]here )\b(?:is|are|was|were)\s+none\b"
    r"|(?<!what it )\b(?:is|are)\s+told\b(?!\s+to\b)|\b[Ww]hoever\b|\b[Nn]obody\b",
    re.MULTILINE,
)
"""Sentences without a subject, and words that stand for one.  "there is none" and "is told to stop" are clear."""


def test_each_class_of_urbihw_has_a_name_of_its_own() -> None:
    """A traceback or a log shows the class alone: it must tell the place.  ``NxtFramer`` does, ``Framer`` does not."""
    places = defaultdict(list)
    folders = (ROOT / "urbihw", ROOT / "packages" / "nao" / "urbihw_nao")
    for path in sorted(path for folder in folders for path in folder.rglob("*.py")):
        for name in CLASSES.findall(TEXTS.sub("", path.read_text("utf-8"))):
            places[name].append(str(path.relative_to(ROOT)))
    assert len(places) > 900
    twins = [f"{name}: {', '.join(found)}" for name, found in places.items() if len(found) > 1 and name not in ALLOWED]
    assert not twins, "classes of the same name; put the package or the device in front:\n" + "\n".join(twins)


def test_sentences_say_what_a_thing_is() -> None:
    """Docstrings, comments, messages and pages have a noun and a verb: "Largest memory of a model, in MiB."."""
    found = []
    for path in sorted(path for pattern in PROSE for path in ROOT.glob(pattern)):
        end = ""
        for number, line in enumerate(path.read_text("utf-8").splitlines(), 1):
            if any(word in line for word in WORDS) and ACCENT.search(f"{end}\n{line}"):
                found.append(f"{path.relative_to(ROOT)}:{number}: {line.strip()}")
            end = line[-4:]  # a phrase may begin there
    assert not found, "say what the thing is, with a noun and a verb:\n" + "\n".join(found)


SHORT: Final = re.compile(r':\n +"""([^\s`"]+(?: +[^\s`"]+){0,2})"""\n')
"""A docstring of three words or less, without code in it."""
REFERENCE: Final = re.compile(r':\n +"""((?:See|As in|As) `{1,2}[\w.]+`{1,2}\.?)"""\n')


def test_docstrings_say_more_than_the_name() -> None:
    """Three words repeat the name: say it in a sentence, or write none.  A method inherits that of the base."""
    found = []
    for path in sorted(path for folder in ("urbihw", "fakes", "packages") for path in (ROOT / folder).rglob("*.py")):
        text = path.read_text("utf-8")
        found += [f"{path.relative_to(ROOT)}: {words}" for words in SHORT.findall(text) + REFERENCE.findall(text)]
    assert not found, "say more, or remove the docstring:\n" + "\n".join(found)
