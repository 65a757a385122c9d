"""The import of the module of a command."""

from __future__ import annotations

import gc
import sys
from importlib import import_module

TYPE_CHECKING = False  # as ``typing`` has it, whose import a stop cannot wait for
if TYPE_CHECKING:
    from typing import Any


def program(name: str) -> Any:
    """Import a module at the start of a process, without Python's garbage collector.

    The collector would go through all modules again and again while their number grows, and find nothing: that is a
    tenth of the start of a daemon.  They are left out of later collections, too, until ``Collector`` thaws them.
    """
    if name in sys.modules:
        return sys.modules[name]
    gc.disable()
    try:
        return import_module(name)
    finally:
        gc.freeze()
        gc.enable()
