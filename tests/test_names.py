"""What the names of classes must be like."""

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


def test_each_class_of_urbihw_has_a_name_of_its_own() -> None:
    """A traceback or a log shows the class alone: it must tell the place.  ``NxtFramer`` does, ``Framer`` does not."""
    places = defaultdict(list)
    for path in sorted((ROOT / "urbihw").rglob("*.py")):
        for name in CLASSES.findall(TEXTS.sub("", path.read_text("utf-8"))):
            places[name].append(str(path.relative_to(ROOT)))
    assert len(places) > 900
    twins = [f"{name}: {', '.join(found)}" for name, found in places.items() if len(found) > 1 and name not in ALLOWED]
    assert not twins, "classes of the same name; put the package or the device in front:\n" + "\n".join(twins)
