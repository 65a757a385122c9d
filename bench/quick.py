"""The option ``--quick`` of the benches: only long enough that each row is printed, for a test that they still run."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any


class SetAmounts(argparse.Action):
    """Gives other options the values of ``const``."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: str | Sequence[Any] | None,
        option_string: str | None = None,
    ) -> None:  # fmt: skip
        setattr(namespace, self.dest, True)
        for name, amount in self.const.items():
            setattr(namespace, name, amount)


def add_quick(parser: argparse.ArgumentParser, **amounts: object) -> None:
    """Add ``--quick``, which sets each named option of the parser to its smallest useful amount."""
    parser.add_argument(
        "--quick", action=SetAmounts, nargs=0, const=amounts, default=False,
        help="only see that each row is printed; the figures mean nothing",
    )  # fmt: skip
