"""The pages of ``docs/reference``, made of what the library says of itself (``stdlib/documentation.py``).

    python -m tests.stdlib.reference_pages

writes them.  What stands under ``## Examples`` of a page is written by hand and kept; ``tests/test_docs.py`` plays it.
"""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

from urbihw.kernel import Kernel
from urbihw.kernel.runtime.code import Primitive
from urbihw.kernel.stdlib.documentation import Docstrings
from urbihw.kernel.stdlib.signatures import arguments
from urbihw.kernel.syntax.tokens import is_identifier
from urbihw.robot import ROBOT_LIBRARY
from urbihw.ros.script import ROS_LIBRARY

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "reference"
EXAMPLES = "## Examples\n"
HIDDEN = {"init", "type"}
"""Slots that need no words: ``init`` is described as the construction, ``type`` is the name of the class."""

CLASSES = (
    "Barrier", "Binary", "CallMessage", "Channel", "Code", "Comparable", "Container", "Control", "Date", "Dictionary",
    "Directory", "Duration", "Enumeration", "Event", "Exception", "Executable", "File", "Finalizable",
    "Float", "Float.limits", "FormatInfo", "Formatter", "Global", "Group", "InputStream", "IoService", "Job",
    "Kernel1", "Lazy", "List", "Loadable", "Lobby", "Location", "Math", "Mutex", "nil", "Object", "Orderable",
    "OutputStream", "Pair", "Path", "Pattern", "Position", "Primitive", "Process", "Profiling", "PseudoLazy", "PubSub",
    "PubSub.Subscriber", "RangeIterable", "Regexp", "Ros", "Ros.Service", "Ros.Topic",
    "Semaphore", "Server", "Singleton", "Socket", "StackFrame",
    "String", "Subscription", "System", "System.PackageInfo", "System.Platform", "Tag", "Timeout", "Traceable",
    "TrajectoryGenerator", "true", "Triplet", "Tuple", "UObject", "UValue", "UVar", "void", "WeakDictionary",
    "WeakPointer",
)  # fmt: skip


def file_name(name: str) -> str:
    """``Float.limits`` is in ``float-limits.md``."""
    return f"{name.lower().replace('.', '-')}.md"


class Pages:
    """The pages of one world's library."""

    def __init__(self) -> None:
        self._world = Kernel(fast=True, libraries=(ROBOT_LIBRARY, ROS_LIBRARY)).world
        self._docs = Docstrings(self._world)

    def all(self) -> dict[str, str]:
        """File name -> what is made of the docstrings, for all pages."""
        made = {file_name(name): self._page(name) for name in CLASSES}
        return {"README.md": self._index(), **made}

    def _class(self, name: str) -> Any:
        holder: Any = self._world.global_
        for part in name.split("."):
            holder = holder.slots[part]
        return holder

    def _index(self) -> str:
        rows = [f"- [{name}]({file_name(name)}): {first(self._docs.about(self._class(name)))}" for name in CLASSES]
        head = "# The classes of urbiscript\n\nOne page each, made of what `System.documentation` says in a console.\n"
        return "\n".join([head, *rows]) + "\n"

    def _page(self, name: str) -> str:
        value = self._class(name)
        parts = [f"# {name}", one_line(self._docs.about(value))]
        protos = [self._world.type_name(proto) for proto in self._world.protos_of(value)]
        if protos:
            parts.append(f"Prototypes: {', '.join(self._link(proto, name) for proto in protos)}.")
        init = self._world.peek_obj(value).slots.get("init")
        if isinstance(init, Primitive):
            said = one_line(inspect.getdoc(init.source) or "")
            parts.append(f"`{name}.new{arguments(init)}`: {said}")
        rows = self._slots(value)
        if rows:
            parts += ["## Slots", "\n".join(rows)]
        return "\n\n".join(parts) + "\n"

    def _link(self, proto: str, name: str) -> str:
        return f"[{proto}]({file_name(proto)})" if proto in CLASSES and proto != name else proto

    def _slots(self, value: Any) -> list[str]:
        """One row for each slot; functions that are the same under several names share one."""
        slots = self._world.peek_obj(value).slots
        rows: dict[Any, tuple[list[str], str]] = {}
        for slot in sorted({*slots, *self._docs.noted(value)} - HIDDEN, key=lambda slot: (slot.lower(), slot)):
            content = slots.get(slot)
            said = self._docs.of(value, slot) if slot in slots else self._docs.of_objects(value, slot)
            key = content.source if isinstance(content, Primitive) and content.source.__doc__ else slot
            shown = f"`{slot if is_plain(slot) else repr(slot)}{arguments(content)}`"
            if not is_plain(slot) and slot.isidentifier():
                shown += " (a keyword, so in quotes)"
            rows.setdefault(key, ([], said))[0].append(shown)
        return [f"- {', '.join(shown)}: {one_line(said)}" for shown, said in rows.values()]


def is_plain(slot: str) -> bool:
    """Whether a slot is used without quotes: it is neither a sign nor a keyword.  ``x.new`` is part of the syntax."""
    return is_identifier(slot) or slot == "new"


def first(text: str) -> str:
    """The first sentence."""
    return one_line(text).partition(".  ")[0].rstrip(".") + "."


def one_line(text: str) -> str:
    """A docstring as a paragraph, which begins with a capital letter."""
    return " ".join((text[:1].upper() + text[1:]).split("\n"))


def examples(page: Path) -> str:
    """What is written by hand at the end of a page."""
    text = page.read_text() if page.exists() else ""
    return EXAMPLES + text.partition(EXAMPLES)[2] if EXAMPLES in text else ""


def main() -> None:
    """Write all pages."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name, text in Pages().all().items():
        page = FOLDER / name
        kept = examples(page)
        page.write_text(f"{text}\n{kept}" if kept else text)


if __name__ == "__main__":
    main()
