"""List the robots that urbihw knows."""

from __future__ import annotations

import argparse
import sys
import tomllib
from pathlib import Path

from urbihw import platforms
from urbihw.exitcodes import EX_CONFIG


def options(parser: argparse.ArgumentParser) -> None:
    """``urbihw platforms`` takes none."""


def run(options: argparse.Namespace) -> int:
    """Print one line for each robot: name, title, progress of its checklist."""
    broken = False
    for folder in platforms.folders():
        try:
            manifest = platforms.read(folder)
        except platforms.BadManifest as error:
            broken = True
            print(f"urbihw: {error}", file=sys.stderr)
            continue
        fake = ", --fake" if manifest.fake else ""
        print(f"{manifest.name:10} {manifest.title} ({maturity(folder)}{fake})")
    return EX_CONFIG if broken else 0


def maturity(folder: Path) -> str:
    """The progress of the checklist, such as ``17 of 18 rules``; rules that do not apply are not counted."""
    path = folder / "checklist.toml"
    if not path.is_file():
        return "no checklist"
    rules = tomllib.loads(path.read_text("utf-8"))["rules"]
    states = [rule["state"] for rule in rules.values()]
    return f"{states.count('done')} of {len(states) - states.count('exempt')} rules"
