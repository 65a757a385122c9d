"""The slots that a device must not hide; ``python tests/platforms/taken_names.py`` writes ``urbihw.platforms.taken``.

Every object of urbiscript inherits from Global, and each device gets a slot of Global: a device ``val`` would be found
in place of the values of a group, a device ``Math`` in place of the functions.
"""

from __future__ import annotations

import importlib
import re
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT / "urbihw/platforms/taken.py"
PLATFORMS = ("bioloid", "chain")
"""The platforms with ``[devices]`` that have tables of all kinds of devices."""
_NUMBERED = re.compile(r"(?:motor|sensor|device|object_)\d+")
_NAME = re.compile(r"[A-Za-z]\w*")
_HEAD = '''\
"""The slots of urbiscript, of the robots and of their devices: names that no device of the settings may have.

Written by ``python tests/platforms/taken_names.py``; a test compares it with the slots there are.
"""

from __future__ import annotations

from typing import Final

_TEXT: Final = """
'''
_TAIL = '''"""
TAKEN: Final = frozenset(_TEXT.split())
"""Names of slots."""
'''


def names() -> set[str]:
    """The names of all slots of Global, of robots on a servo bus, of their trees and of their devices."""
    found: set[str] = set()
    for platform in PLATFORMS:
        lab = importlib.import_module(f"{platform}_lab").Lab.ready()
        slots = lab.kernel.world.global_.slots
        body = slots["robot"].slots["body"]
        numbered = [value for name, value in slots.items() if _NUMBERED.fullmatch(name)]
        for target in (lab.kernel.world.global_, slots[platform], slots["robot"], body, *numbered):
            found.update(_slots_of(target))
    return {name for name in found if _NAME.fullmatch(name) and not _NUMBERED.fullmatch(name)}


def _slots_of(target: Any) -> Iterator[str]:
    waiting, seen = [target], set[int]()
    while waiting:
        each = waiting.pop()
        if id(each) not in seen and hasattr(each, "slots"):
            seen.add(id(each))
            yield from each.slots
            waiting += each.protos


def text() -> str:
    """The module."""
    lines = textwrap.wrap(" ".join(sorted(names())), 116, break_on_hyphens=False)
    return _HEAD + "".join(f"{line}\n" for line in lines) + _TAIL


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT / "fakes"))
    FILE.write_text(text(), "utf-8")
