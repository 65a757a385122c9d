"""A platform as a package of its own, installed in a folder of ``sys.path`` as pip would."""

from __future__ import annotations

import tomllib
from pathlib import Path

from urbihw.cli.main import main


def install_outside(root: Path, name: str) -> None:
    """Write what ``urbihw new-platform NAME --package`` makes, and its metadata."""
    assert main(("new-platform", name, "--package", str(root))) == 0
    project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    write_metadata(root, project["name"], project["entry-points"])


def write_metadata(root: Path, wheel: str, groups: dict[str, dict[str, str]]) -> None:
    """Write the metadata of an installed wheel with these entry points."""
    folder = root / f"{wheel.replace('-', '_')}-0.1.0.dist-info"
    folder.mkdir(parents=True)
    (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {wheel}\nVersion: 0.1.0\n")
    with (folder / "entry_points.txt").open("w") as file:
        for group, rows in groups.items():
            file.write(f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in rows.items()))
