"""Makes a typed Python module of a robot from its tree (``System.treeText``, docs/telemetry.md): text out, no sockets.

Editors and type checkers then know the robot's devices, their slots, units and meanings.  At run time the module only
connects: no object is of its classes.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from keyword import iskeyword
from typing import Any, Final

Node = Mapping[str, Any]

TYPES: Final = {
    "number": "float", "truth": "bool", "text": "str", "list": "list[Any]", "dictionary": "dict[str, Any]",
    "binary": "Blob", "function": "UrbiFunction",
}  # fmt: skip
"""Kind of a slot in the tree -> type in Python; all others are objects."""
WIDTH: Final = 110
_TAKEN: Final = frozenset(
    ("slot", "run", "stop", "estop", "write", "joints", "overview", "lease", "watch", "pictures", "events", "plot",
     "close", "connected", "messages", "urbiscript_path")
)  # fmt: skip
"""Attributes of the library's own classes, which a class of the module must not hide."""
_HEAD: Final = '''"""The robot {name}, typed: written by `urbihw stubs`.  Write it anew when the robot has changed."""

from __future__ import annotations

from typing import Any, cast

import urbihw
from urbihw.client.media import Blob
from urbihw.client.objects import UrbiFunction, UrbiObject
from urbihw.client.robot import Robot

__all__ = ["Blob", "UrbiFunction", "UrbiObject", "connect"]
'''
_TAIL: Final = '''

def connect(*args: Any, **kwargs: Any) -> {robot}:
    """Connect to the robot, as urbihw.connect."""
    return cast({robot}, urbihw.connect(*args, **kwargs))
'''


def stubs_text(tree: str) -> str:
    """The module, from the JSON text of a tree.  Raises ValueError for any other text."""
    try:
        told = json.loads(tree)
        platform = told.get("platform") or {}
        name = str(platform.get("name") or "robot")
        maker = _Maker()
        members = {}
        for part in _parts(told["robot"]):
            if part.get("global"):
                members[part["global"]] = maker.class_of(part)
        for group in told.get("groups", []):
            members.setdefault(group["name"], "UrbiObject")
        robot = maker.free_name(f"{_class_name(name)}Robot")
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"the server told no tree of a robot: {error!r}") from error
    lines = [f"    {member}: {kind}" for member, kind in members.items() if _is_usable(member)]
    body = "\n".join(lines) or "    pass"
    made = f'\n\nclass {robot}(Robot):\n    """The robot and its devices."""\n\n{body}\n'
    return _HEAD.format(name=_quoted(name)) + "".join(maker.texts) + made + _TAIL.format(robot=robot)


def _parts(node: Node) -> Iterator[Node]:
    """A part and all parts in it."""
    yield node
    for part in node.get("parts", []):
        yield from _parts(part)


class _Maker:
    """Makes a class for each kind of device; devices of a class with the same slots share it."""

    def __init__(self) -> None:
        self.texts: list[str] = []
        self._known: dict[str, str] = {}
        self._names = {"Any", "Blob", "UrbiFunction", "UrbiObject", "Robot"}

    def class_of(self, part: Node) -> str:
        """The name of the class of a part, which is made if there is none yet."""
        slots = [text for slot in part.get("slots", []) for text in _slot_lines(slot)]
        known = str(part["class"]) + "\n".join(slots)
        if known not in self._known:
            name = self._known[known] = self.free_name(_class_name(str(part["class"])))
            title = f'    """A device of class {_quoted(str(part["class"]))}."""\n'
            self.texts.append(f"\n\nclass {name}(UrbiObject):\n{title}" + "".join(f"{line}\n" for line in slots))
        return self._known[known]

    def free_name(self, wanted: str) -> str:
        """A name of a class that is not taken."""
        name, number = wanted, 1
        while name in self._names:
            number += 1
            name = f"{wanted}{number}"
        self._names.add(name)
        return name


def _slot_lines(slot: Node) -> Iterator[str]:
    """The lines of a slot: a variable, or a property if it cannot be assigned."""
    name = str(slot["name"])
    if not _is_usable(name) or not (slot["readable"] or slot["writable"] or slot["kind"] in ("function", "event")):
        return
    kind = TYPES.get(str(slot["kind"]), "UrbiObject")
    said = _meaning(slot)
    yield ""
    if slot["writable"] or kind.startswith("Urbi"):
        yield f"    {name}: {kind}"
        if said:
            yield f'    """{said}"""'
    else:
        yield "    @property"
        yield f"    def {name}(self) -> {kind}:"
        if said:
            yield f'        """{said}"""'
        yield "        raise NotImplementedError"


def _meaning(slot: Node) -> str:
    """Meaning, unit and range in one line."""
    unit = str(slot["unit"])
    limits = [] if slot["min"] is None or slot["max"] is None else [f"{slot['min']:g} to {slot['max']:g}"]
    told = ", ".join([*([unit] if unit not in ("", "1") else []), *limits])
    text = " ".join(filter(None, (str(slot["meaning"]), told and f"({told})")))
    return _quoted(text if len(text) <= WIDTH else text[: WIDTH - 4] + " ...")


def _quoted(text: str) -> str:
    """A text that can stand between triple quotes."""
    return " ".join(text.replace("\\", "/").replace('"', "'").split())


def _is_usable(name: str) -> bool:
    """Whether Python can write it as an attribute of a device."""
    return name.isidentifier() and not iskeyword(name) and not name.startswith("_") and name not in _TAKEN


def _class_name(name: str) -> str:
    """The name of a class, from a word of the server."""
    word = "".join(part[:1].upper() + part[1:] for part in name.split("_") if part)
    return word if word.isidentifier() and not iskeyword(word) else "Device"
