"""The settings file as a JSON schema, for editors, generated from the rules of the loader.

A schema cannot express all rules: that numbers must rise, that a whole number is not written 1.0, the parameters of a
url.  ``urbihw config check`` checks them.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Collection
from typing import Any, Final

from urbihw import platforms
from urbihw.daemon.config import Config
from urbihw.platforms import DeviceLimits, DeviceSettings, Manifest
from urbihw.settings import SettingsTable

DRAFT: Final = "https://json-schema.org/draft/2020-12/schema"
_ROW: Final = re.compile(r"^    ([\w, ]+): (.*(?:\n     .*)*)", re.MULTILINE)


def schema() -> dict[str, Any]:
    """The schema, without the platforms that cannot be read: ``urbihw doctor`` tells what is wrong with them."""
    robots = [(manifest, options) for manifest in platforms.manifests() if (options := _options_of(manifest))]
    made = of_table(Config)
    made["properties"]["platform"]["enum"] = ["", *(manifest.name for manifest, _ in robots)]
    made["properties"]["limits"] |= _limits(None)
    made["properties"]["devices"] |= {"additionalProperties": _device()}
    return {
        "$schema": DRAFT,
        "title": "The settings of urbihw",
        **made,
        "not": {
            "anyOf": [
                {"properties": {"url": {"minLength": 1}, "fake": {"const": True}}, "required": ["url", "fake"]},
                {"properties": {"world": {"minLength": 1}, "fake": {"const": False}}, "required": ["world"]},
            ]
        },
        "allOf": [_of_platform(manifest, options) for manifest, options in robots],
    }


def of_table(table: type[SettingsTable]) -> dict[str, Any]:
    """The rows of a table, with their defaults and descriptions."""
    default, about = table(), meanings(table)
    rows = {}
    for name, rule in table.rules().items():
        value = getattr(default, name)
        rows[name] = rule.schema() | {"default": list(value) if isinstance(value, tuple) else value}
        if name in about:
            rows[name]["description"] = about[name]
    return {"type": "object", "additionalProperties": False, "properties": rows}


def meanings(table: type[SettingsTable]) -> dict[str, str]:
    """The descriptions of the rows of a table, by name, from "Attributes" in its docstring and in those of its
    bases."""
    found: dict[str, str] = {}
    for kind in reversed(table.__mro__):
        _, _, rows = inspect.cleandoc(kind.__doc__ or "").partition("Attributes:\n")
        for names, text in _ROW.findall(rows):
            found |= {name.strip(): " ".join(text.split()) for name in names.split(",")}
    return found


def _options_of(manifest: Manifest) -> type[SettingsTable] | None:
    try:
        return platforms.load_options(manifest)
    except platforms.BadManifest:
        return None


def _of_platform(manifest: Manifest, options: type[SettingsTable]) -> dict[str, Any]:
    """The schema of a file that names the platform of ``manifest``, with its options."""
    tables = {"options": of_table(options), "limits": _limits(manifest)}
    if not manifest.devices:
        tables["devices"] = {"maxProperties": 0}
    return {
        "if": {"properties": {"platform": {"const": manifest.name}}, "required": ["platform"]},
        "then": {"properties": tables},
    }


def _device() -> dict[str, Any]:
    """The schema of an expected device: its id, or a table."""
    row = of_table(DeviceSettings) | {"required": ["id"]}
    del row["properties"]["id"]["default"]
    del row["properties"]["limits"]["default"]
    return {"anyOf": [DeviceSettings.rules()["id"].schema(), row]}


def _limits(manifest: Manifest | None) -> dict[str, Any]:
    """The schema of the table of limits, for one platform or for any."""
    if manifest is None:
        return _kinds(DeviceLimits.rules()) | {"additionalProperties": _kinds(DeviceLimits.rules()) | _CLOSED}
    kinds = [kind for kind in DeviceLimits.rules() if any(kind in known for known in manifest.limits.values())]
    devices = {
        f"^{re.escape(name).replace(chr(92) + '#', '[0-9]+')}$": _kinds(known) | _CLOSED
        for name, known in manifest.limits.items()
    }
    return _kinds(kinds) | {"patternProperties": devices} | _CLOSED


_CLOSED: Final = {"additionalProperties": False}


def _kinds(known: Collection[str]) -> dict[str, Any]:
    about = meanings(DeviceLimits)
    rows = {kind: rule.schema() | {"description": about[kind]} for kind, rule in DeviceLimits.rules().items()}
    return {"type": "object", "properties": {kind: row for kind, row in rows.items() if kind in known}}
