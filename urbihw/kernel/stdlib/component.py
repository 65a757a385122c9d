"""Component: a node of a robot's structure tree; all of it is said in urbiscript (manual, chapter 22)."""

from __future__ import annotations

PROTOS = {"Component": ("Object",), "Localization": ("Object",)}
"""Made here because Localizer, whose half is native, derives from them before any urbiscript runs."""
