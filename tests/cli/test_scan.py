"""``urbihw scan``: what is found, line by line, and what is said when nothing is."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from urbihw import platforms
from urbihw.cli.main import main
from urbihw.platforms.spykee import discovery


def test_each_robot_is_a_line_with_its_url(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    robots = [discovery.FoundRobot("10.0.0.7:9000", "SPYKEE1", ""), discovery.FoundRobot("10.0.0.8:9000", "B", "admin")]
    monkeypatch.setattr(discovery, "search", lambda: iter(robots))
    assert main(["scan", "spykee"]) == 0
    lines = "spykee://10.0.0.7:9000  SPYKEE1\nspykee://10.0.0.8:9000  B, in use by admin\n"
    assert capsys.readouterr().out == lines


def test_nobody_and_no_network_are_said(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def no_network() -> Iterator[object]:
        raise OSError(101, "Network is unreachable")

    for search, words in ((lambda: iter(()), "no spykee answers"), (no_network, "Network is unreachable")):
        monkeypatch.setattr(discovery, "search", search)
        assert main(["scan", "spykee"]) == 69
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith("urbihw: ") and words in line


@pytest.mark.parametrize(
    ("platform", "words"), [("bioloid", "cannot be looked for"), ("spyke", "did you mean spykee?")]
)
def test_what_cannot_be_looked_for(platform: str, words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scan", platform]) == 78
    assert words in capsys.readouterr().err


def test_a_manifest_that_names_no_function_is_said() -> None:
    manifest = platforms.find("spykee")
    for scan in ("discovery:none", "nowhere:scan"):
        wrong = platforms.Manifest(**{**vars(manifest), "scan": scan})
        with pytest.raises(platforms.BadManifest, match=r"platform.toml: scan: "):
            platforms.scan(wrong)
