"""What urbiscript passes around, as a type."""

from __future__ import annotations

from typing import Any, NewType, TypeAlias

Value: TypeAlias = Any
"""An urbiscript value: a Python ``float`` for a Float without slots of its own, else an ``Obj`` of the runtime.

The checker knows only that it may be anything: nearly every value is asked for its class before it is used,
in places that are too hot for a second check.  ``Any`` elsewhere means that nothing is known.
"""

ValueOrText = NewType("ValueOrText", object)
"""An argument of a built-in that gets a literal of the program as a Python ``str``, and anything else as a Value."""
