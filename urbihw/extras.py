"""The command that installs an extra into this installation of urbihw.

urbihw is on no package index, so ``pip install 'urbihw[usb]'`` finds nothing: the packages of the extra are named
instead, for the way in which urbihw was installed.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final, NamedTuple

DEBIAN_FOLDER: Final = "/usr/lib/python3/dist-packages"
"""Where Debian's packages of Python modules are."""
_DEBIAN: Final = {
    "usb": "python3-usb",
    "navigation": "python3-numpy python3-scipy",
    "console": "python3-prompt-toolkit python3-pygments",
    "images": "python3-pil",
    "evdev": "python3-evdev",
    "monitor": "python3-rich",
    "find": "python3-zeroconf",
    "web": "python3-aiohttp python3-segno",
}
"""Extra -> packages of Debian, where Debian has all of them."""
_PACKAGE: Final = re.compile(r"[\w.-]+")
_EXTRA: Final = re.compile(r"\bextra == [\"']([\w-]+)[\"']")


class Requirement(NamedTuple):
    """A package that urbihw requires: its name, its name with the range, and the extra, "" for none."""

    name: str
    text: str
    extra: str


def install_command(
    *extras: str, wheel: str = "urbihw", folder: Path | None = None, prefix: Path | None = None
) -> str:
    """The command, as advice to the user.

    ``wheel`` is the one that has these extras.  ``folder`` is that of the package urbihw, ``prefix`` that of the Python
    environment; by default, of this process.
    """
    folder, prefix = folder or Path(__file__).parent, prefix or Path(sys.prefix)
    if folder.is_relative_to(DEBIAN_FOLDER):
        lacking = [extra for extra in extras if extra not in _DEBIAN]
        if lacking:
            return (f"Debian has no packages for {' and '.join(lacking)}: install urbihw in an environment of its own "
                    "(docs/operations.md)")
        return f"sudo apt install {' '.join(_DEBIAN[extra] for extra in extras)}"
    packages = " ".join(package for extra in extras for package in _requirements(wheel, extra))
    if (prefix / "pipx_metadata.json").exists():
        return f"pipx inject urbihw {packages}"
    return f"{prefix}/bin/pip install {packages}"


def required_packages(wheel: str = "urbihw") -> Iterator[Requirement]:
    """All packages that the metadata of an installed wheel name, in either of its spellings: ``lark<2,>=1.1.5`` and
    ``lark (<2,>=1.1.5)``."""
    # Imported only now: it brings in email, zipfile and others, a sixth of what a worker imports.
    from importlib.metadata import PackageNotFoundError, requires

    try:
        rows = requires(wheel) or []
    except PackageNotFoundError:
        rows = []
    for row in rows:
        package, _, marker = row.partition(";")
        text = re.sub(r"[\s()]", "", package)
        name, extra = _PACKAGE.match(text), _EXTRA.search(marker)
        if name is not None:
            yield Requirement(name[0], text, extra[1] if extra else "")


def _requirements(wheel: str, extra: str) -> Iterator[str]:
    """The packages of an extra with their ranges, quoted for a shell."""
    found = [each.text for each in required_packages(wheel) if each.extra == extra]
    yield from (f"'{package}'" for package in found or [f"{wheel}[{extra}]"])
