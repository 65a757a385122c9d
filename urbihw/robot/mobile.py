"""Mobility: the slots of ``Interface.Mobile`` that are derived from others, implemented in urbiscript."""

from __future__ import annotations

PROTOS = {"Mobility": ("Object",)}
