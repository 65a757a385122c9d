"""How large a type of messages is, before memory is taken for it: a peer may have made its definition."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from urbihw.ros.errors import RosError

MAX_DEPTH: Final = 32
"""Maximum depth of messages in messages; ROS forbids those that contain themselves."""
MAX_ELEMENTS: Final = 20_000
"""Maximum number of values in a message whose lists are empty, of a type that peers and files add."""
NO_FIELD: Final = "structure_needs_at_least_one_member"
"""The field that the library adds to a message without fields; it is not sent."""


class TypeSize(NamedTuple):
    """The size of a type.

    Attributes:
        elements: number of its values, those of arrays of fixed size too.
        sent: whether it has any bytes.
        height: depth of messages in it, 1 for none.
    """

    elements: int
    sent: bool
    height: int


class TypeSizes:
    """The sizes of a type and of those in it; each is looked at once, however often it is used."""

    def __init__(self, name: str, fielddefs: Mapping[str, Any]) -> None:
        """``name`` is for errors; ``fielddefs`` are the definitions of the library rosbags, by its names."""
        self._name = name
        self._fielddefs = fielddefs
        self._found: dict[str, TypeSize] = {}

    def of(self, inner: str, above: tuple[str, ...]) -> TypeSize:
        """The size of a type inside of others.  Raises RosError for one that is huge, contains itself or an unknown
        one, or has lists of messages without bytes, of which a few bytes would tell billions.
        """
        found = self._found.get(inner)
        if inner in above or len(above) + (found.height if found else 0) > MAX_DEPTH:
            raise RosError(f"type {self._name} contains itself, or nests more than {MAX_DEPTH} deep")
        if found is not None:
            return found
        if inner not in self._fielddefs:
            raise RosError(f"the definition of {self._name} lacks {inner.replace('/msg/', '/')}")
        parts = [self._of_field(kind, (*above, inner)) for name, kind in self._fielddefs[inner][1] if name != NO_FIELD]
        found = TypeSize(sum(part.elements for part in parts), any(part.sent for part in parts),
                         1 + max((part.height for part in parts), default=0))
        if found.elements > MAX_ELEMENTS:
            raise RosError(f"type {self._name} has more than {MAX_ELEMENTS} values")
        self._found[inner] = found
        return found

    def _of_field(self, kind: Any, above: tuple[str, ...]) -> TypeSize:
        node, of = kind
        if node.name == "BASE":
            return TypeSize(1, True, 0)
        if node.name == "NAME":
            return self.of(of, above)
        element = self._of_field(of[0], above)
        if node.name == "ARRAY":
            count = of[1]
            return TypeSize(count * max(element.elements, 1), element.sent and count > 0, element.height)
        if not element.sent:
            raise RosError(f"type {self._name} has a list of messages without bytes")
        return TypeSize(1, True, element.height)
