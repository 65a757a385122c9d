"""The modules that need numpy and scipy, the extra ``navigation``; loaded when they are needed first."""

from __future__ import annotations

import functools
import importlib
from types import ModuleType
from typing import Any

from urbihw.extras import install_command


@functools.cache
def _load(name: str) -> ModuleType | None:
    try:
        return importlib.import_module(f"urbihw.navigation.{name}")
    except ImportError:
        return None


def how_to_install() -> str:
    """The command that installs the extra."""
    return install_command("navigation")


def load_arrays() -> Any:
    """The module ``arrays``; None without the extra."""
    return _load("arrays")


def load_montecarlo() -> Any:
    """The module ``montecarlo``; None without the extra."""
    return _load("montecarlo")


def load_mapping() -> Any:
    """The module ``mapping``; None without the extra."""
    return _load("mapping")
