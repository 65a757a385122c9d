"""List the robots that urbihw knows."""

from __future__ import annotations

import argparse
import json
import sys
import tomllib
from pathlib import Path

from urbihw import platforms
from urbihw.exitcodes import EX_CONFIG
from urbihw.kernel.uobject import BadConfig


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw platforms``."""
    parser.add_argument("--on-robot", metavar="NAME", help="print the program of this platform for the robot itself")
    parser.add_argument("--json", action="store_true", help="for programs")


def run(options: argparse.Namespace) -> int:
    """Print one line for each robot: name, title, progress of its checklist; or a program."""
    if options.on_robot is not None:
        return print_program(options.on_robot)
    broken, rows = False, []
    for folder in platforms.folders():
        try:
            manifest = platforms.read(folder)
        except platforms.BadManifest as error:
            broken = True
            print(f"urbihw: {error}", file=sys.stderr)
            continue
        fake = ", --fake" if manifest.fake else ""
        if options.json:
            rows.append({"name": manifest.name, "title": manifest.title, "wheel": manifest.wheel or "urbihw",
                         "checklist": maturity(folder.path), "fake": bool(manifest.fake)})
            continue
        print(f"{manifest.name:10} {manifest.title} ({maturity(folder.path)}{fake})")
    if options.json:
        print(json.dumps(rows, indent=2, ensure_ascii=False))
    return EX_CONFIG if broken else 0


def print_program(name: str) -> int:
    """Print the program of a platform that runs on the robot itself."""
    try:
        manifest = platforms.find(name)
    except BadConfig as error:
        print(f"urbihw: {error}", file=sys.stderr)
        return EX_CONFIG
    if not manifest.on_robot:
        print(f"urbihw: platform {name} has no program for the robot itself", file=sys.stderr)
        return EX_CONFIG
    print((manifest.folder / manifest.on_robot).read_text("utf-8"), end="")
    return 0


def maturity(folder: Path) -> str:
    """The progress of the checklist, such as ``17 of 18 rules``; rules that do not apply are not counted."""
    path = folder / "checklist.toml"
    if not path.is_file():
        return "no checklist"
    rules = tomllib.loads(path.read_text("utf-8"))["rules"]
    states = [rule["state"] for rule in rules.values()]
    return f"{states.count('done')} of {len(states) - states.count('exempt')} rules"
