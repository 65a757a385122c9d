"""Arguments of a call that was compiled as strict and whose function turns out to be lazy when it is called.

The compiler cannot know which functions are lazy; names that are known to belong to lazy functions get their arguments
as Python functions from the start, all other calls are compiled strict.  When such a call meets a lazy function after
all, its arguments are compiled, the first time, as expressions that reach the local variables of the waiting Python
frame through ``FrameLocals``.  Each call takes twice as long as one whose function was known to be lazy.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from types import FrameType
from typing import Any

from urbihw.kernel.compiler.linemap import LineMap
from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.binding import Known, Names
from urbihw.kernel.syntax.pace import StepPace


class LateSites:
    """The calls of one unit, by number."""

    __slots__ = ("_sites",)

    def __init__(self) -> None:
        self._sites: list[tuple[ast.Call, Known]] = []

    def add(self, node: ast.Call, pace: StepPace) -> int:
        """Remember a call and where the locals that its arguments name live; its number."""
        names = node.bound.known = _names(node.args or (), pace)
        self._sites.append((node, names))
        return len(self._sites) - 1

    def arguments(self, site: int) -> tuple[ast.Node, ...]:
        """The argument nodes of a call."""
        return self._sites[site][0].args or ()

    def thunks(
        self, site: int, frame: FrameType, place: LineMap, this: Any, run: Callable[..., Any]
    ) -> list[Callable[[], Any]]:
        """The arguments of a call as functions; ``run(node, this, locals)`` evaluates a node that sees ``locals``."""
        node, names = self._sites[site]
        local = FrameLocals(frame, names.all(), place)
        return [lambda arg=arg: run(arg, this, local) for arg in node.args or ()]  # type: ignore[misc]


class FrameLocals:
    """The local variables of a Python frame by their urbiscript names, to read and to write; ``place`` is where the
    statement of the frame stands."""

    __slots__ = ("_frame", "names", "place")

    def __init__(self, frame: FrameType, names: Names, place: LineMap) -> None:
        self._frame = frame
        self.names = names
        self.place = place

    def read(self, name: str) -> Any:
        """The value of a local."""
        python, boxed = self.names[name]
        value = self._frame.f_locals[python]
        return value.v if boxed else value

    def write(self, name: str, value: Any) -> None:
        """Assign a local of the frame."""
        python, boxed = self.names[name]
        variables = self._frame.f_locals
        if boxed:
            variables[python].v = value
            return
        variables[python] = value
        if sys.version_info < (3, 13):  # from 3.13 on f_locals writes through
            ctypes.pythonapi.PyFrame_LocalsToFast(ctypes.py_object(self._frame), ctypes.c_int(0))


def _names(nodes: tuple[ast.Node, ...], pace: StepPace) -> Known:
    """All locals that the nodes name."""
    found: Names = {}
    inner: list[Known] = []
    todo: list[Any] = list(nodes)
    while todo:
        pace.step()
        node = todo.pop()
        if isinstance(node, tuple):
            todo.extend(node)
        elif isinstance(node, ast.Node):
            bound = node.bound
            if bound.local is not None:
                found[bound.local.name] = (bound.local.python, bound.local.boxed)
            if bound.known is not None:
                assert isinstance(node, ast.Call)
                inner.append(bound.known)
                todo.append(node.target)
            else:
                todo.extend([getattr(node, link) for link in node.links])
    return inner[0] if len(inner) == 1 and not found else Known(found, tuple(inner))
