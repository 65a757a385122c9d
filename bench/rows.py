"""How the benches of the kernel print a figure beside its budget."""

from __future__ import annotations

COLUMNS = "{:46} {:>12} {:>12} {:>9} {:>9}  {}"


def row(what: str, ours: str, peer: str, measured: float, budget: float, unit: str = "") -> None:
    """Print a figure beside its budget; below is good."""
    verdict = "" if measured <= budget else "OVER"
    print(COLUMNS.format(what, ours, peer, f"{measured:.3g}{unit}", f"{budget:g}{unit}", verdict), flush=True)
