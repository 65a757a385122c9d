"""Platforms and navigation reach the kernel by the UObject API alone: nothing behind their host is theirs."""

from __future__ import annotations

import ast
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("urbihw/platforms", "urbihw/navigation", "packages/nao/urbihw_nao")
FILES = [path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*.py"))]
BEHIND_THE_HOST = {"world", "registry", "observer"}


def test_nothing_behind_the_host_is_used() -> None:
    reached = [
        f"{path.name}:{node.lineno}: host.{node.attr}"
        for path in FILES
        if any(f".{name}" in (text := path.read_text("utf-8")) for name in BEHIND_THE_HOST)
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Attribute)
        and node.attr in BEHIND_THE_HOST
        and ((isinstance(node.value, ast.Attribute) and node.value.attr == "host")
             or (isinstance(node.value, ast.Name) and node.value.id == "host"))
    ]  # fmt: skip
    assert reached == []
