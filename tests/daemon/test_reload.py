"""What a reload of the settings refuses: a file that an editor is writing just now."""

from __future__ import annotations

from pathlib import Path

import pytest

from urbihw.daemon.config import Loaded, load_faultless
from urbihw.daemon.reload import check_whole
from urbihw.kernel.uobject import BadConfig

WHOLE = """platform = "bioloid"
rate = 50
[limits]
speed = 1.0
[limits.motor6]
speed = 0.5
[options]
protocol = 1
"""


def read(folder: Path, text: str) -> Loaded:
    """What a file and the command line say."""
    file = folder / "robot.toml"
    file.write_text(text)
    return load_faultless(file, {"platform": "bioloid"})


@pytest.mark.parametrize("text", ["", "\n", "# the settings of my robot\n"])
def test_an_empty_file_is_refused(tmp_path: Path, text: str) -> None:
    served = read(tmp_path, WHOLE).config
    with pytest.raises(BadConfig, match="robot.toml: is empty: read it again when it is written"):
        check_whole(served, read(tmp_path, text))


def test_a_file_that_was_empty_may_stay_so(tmp_path: Path) -> None:
    check_whole(read(tmp_path, "").config, read(tmp_path, ""))


def test_a_file_without_the_tables_of_the_robot_is_refused_unless_it_says_so(tmp_path: Path) -> None:
    served = read(tmp_path, WHOLE).config
    half = WHOLE[: WHOLE.index("[limits]")]
    with pytest.raises(BadConfig, match=r"has no \[limits\] and no \[options\], unlike the settings in force"):
        check_whole(served, read(tmp_path, half))
    with pytest.raises(BadConfig, match=r"has no \[options\], unlike"):
        check_whole(served, read(tmp_path, WHOLE[: WHOLE.index("[options]")]))
    check_whole(served, read(tmp_path, half + "[limits]\n[options]\n"))
    check_whole(served, read(tmp_path, WHOLE.replace("0.5", "0.7")))
