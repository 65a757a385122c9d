"""Show what becomes of urbiscript source on its way to Python: tokens, syntax tree, generated code."""

from __future__ import annotations

import argparse


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw dump``."""


def run(options: argparse.Namespace) -> int:
    return 0
