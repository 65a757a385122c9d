"""Mobility: how a robot that can drive gets the rest of ``Interface.Mobile``; all of it is said in urbiscript."""

from __future__ import annotations

PROTOS = {"Mobility": ("Object",)}
