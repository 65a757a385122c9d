"""Pictures of the panel of every platform, with its simulated robot: for a look at them, and for the README.

python -m bench.panel_pictures FOLDER                  # control page of every platform, light, dark and phone
python -m bench.panel_pictures FOLDER bioloid plots    # one page of one platform
python -m bench.panel_pictures --readme                # the two of the README, in docs/pictures
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Final

from panel_lab import Scene, Visitor, open_browser

from bench import ROOT

if TYPE_CHECKING:
    from playwright.sync_api import Browser

PLATFORMS: Final = ("bioloid", "p3dx", "nxt", "segway", "spykee", "nao", "chain", "so101", "cia402")
Looks = tuple[tuple[str, int, int, bool], ...]
LOOKS: Final[Looks] = (("light", 1280, 900, False), ("dark", 1280, 900, True), ("phone", 390, 800, False))
MOVES: Final = {
    "bioloid": "bioloid.on; for& (var i : 6) { joint[i + 1].val = 0 sin:4s ampli:(20deg + i * 8deg) },",
    "p3dx": "P3dx.body.load = 1; P3dx.body.laser.load = 1; robot.go(1.2); robot.turn(-60deg); robot.go(0.6);",
}
"""What the robot does meanwhile, so that there is something to see."""
README: Final = ROOT / "docs" / "pictures"
SETTLE_S: Final = 3.0


def draw(browser: Browser, platform: str, page: str, looks: Looks, folder: Path) -> None:
    """Write the pictures of a page of a platform."""
    with tempfile.TemporaryDirectory() as state:
        scene = Scene(platform, Path(state), body=None)
        try:
            with scene.run(MOVES.get(platform, "")):
                for name, width, height, dark in looks:
                    visitor = Visitor(browser, scene.pair("full", "anna"), width=width, height=height, dark=dark,
                                      figure=True)  # fmt: skip
                    visitor.open(page)
                    time.sleep(SETTLE_S * (3 if platform == "p3dx" else 1))
                    path = folder / f"{platform}-{page}-{name}.png"
                    visitor.page.screenshot(path=str(path), full_page=name != "readme")
                    visitor.close()
                    print(path, *visitor.errors, sep="\n  ")
        finally:
            scene.close()


def main(words: list[str]) -> None:
    """Write the pictures that the command line asks for."""
    with open_browser() as browser:
        if words == ["--readme"]:
            for platform in ("bioloid", "p3dx"):
                draw(browser, platform, "control", (("readme", 1100, 720, platform == "p3dx"),), README)
            return
        folder = Path(words[0])
        folder.mkdir(parents=True, exist_ok=True)
        for platform in words[1:2] or PLATFORMS:
            draw(browser, platform, words[2] if len(words) > 2 else "control", LOOKS, folder)


if __name__ == "__main__":
    main(sys.argv[1:] or ["panel-pictures"])
