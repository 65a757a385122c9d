"""Component: a node of a robot's structure tree, implemented in urbiscript (manual, chapter 22)."""

from __future__ import annotations

PROTOS = {"Component": ("Object",), "Localization": ("Object",)}
"""Made here because Localizer, which has a native half, derives from them before any urbiscript runs."""
