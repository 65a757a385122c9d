"""The sabotages of this folder as data: small changes of the sources, each with the tests that must notice it.

A row of a ``*.toml`` file:

    [[mutant]]
    name = "what is wrong then"
    file = "urbihw/buses/gate.py"
    text = '''the lines as they are, which occur once in the file'''
    put = '''what takes their place'''
    tests = ["tests/buses/test_gate.py::test_of_it"]
"""

from __future__ import annotations

import ast
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[2]
FOLDER: Final = Path(__file__).parent


@dataclass(frozen=True)
class Mutant:
    """One sabotage; ``text`` of ``file`` is replaced by ``put``, and one of ``tests`` must fail then."""

    name: str
    file: str
    text: str
    put: str
    tests: tuple[str, ...]

    def sabotaged(self, source: str) -> str:
        """Return the source with the sabotage.  Raises ValueError if the text does not occur once."""
        count = source.count(self.text)
        if count != 1:
            raise ValueError(f"{self.name}: the text occurs {count} times in {self.file}, not once; correct the row")
        return source.replace(self.text, self.put)


def load() -> list[Mutant]:
    """Return all rows.  Raises TypeError or KeyError for a row with other keys."""
    found = []
    for file in sorted(FOLDER.glob("*.toml")):
        for row in tomllib.loads(file.read_text("utf-8"))["mutant"]:
            found.append(Mutant(**(row | {"tests": tuple(row["tests"])})))
    return found


def problems(mutant: Mutant) -> list[str]:
    """Return why a row cannot be played: another text in the source, no Python afterwards, no such test."""
    found = []
    try:
        sabotaged = mutant.sabotaged((ROOT / mutant.file).read_text("utf-8"))
        if mutant.file.endswith(".py"):
            ast.parse(sabotaged)
        if mutant.text == mutant.put:
            found.append(f"{mutant.name}: nothing is changed")
    except (OSError, SyntaxError, ValueError) as error:
        found.append(f"{mutant.name}: {error}")
    for test in mutant.tests:
        file, _, name = test.partition("::")
        path = ROOT / file
        if not path.is_file() or (name and f"def {name.partition('[')[0]}(" not in path.read_text("utf-8")):
            found.append(f"{mutant.name}: there is no test {test}")
    return found if mutant.tests else [*found, f"{mutant.name}: no tests"]
