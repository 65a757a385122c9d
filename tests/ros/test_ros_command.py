"""``urbihw ros``: whose emergency stop it is (as for ``urbihw panel``), and what ends it."""

from __future__ import annotations

import argparse
import asyncio
from pathlib import Path
from typing import Any

import pytest

from urbihw.cli import panel, reach, ros
from urbihw.ros.errors import PeerError, RosError, RosNameTaken
from urbihw.ros.robot.bridge import RosRobot, RosRobotSettings

OTHER = Path("/run/urbihw/p3dx-54000.sock")
OWN = Path("/run/urbihw/nao-54001.sock")


@pytest.mark.parametrize(("words", "wanted"), [
    ([], OTHER), (["127.0.0.1:54000"], OTHER), (["localhost:54001"], OWN), (["127.0.0.1:54002"], None),
    (["192.0.2.1:54000"], None), (["/run/urbihw/nao.sock"], None), (["/run/urbihw/nao.sock", "--child"], None),
    (["127.0.0.1:54000", "--child"], None), (["--child", "--control", str(OWN), "/run/urbihw/nao.sock"], OWN),
])  # fmt: skip
def test_emergency_stop_of_no_other_robot(
    monkeypatch: pytest.MonkeyPatch, words: list[str], wanted: Path | None
) -> None:
    monkeypatch.setattr(reach, "control_sockets", lambda: [OTHER, OWN])
    for command in (ros, panel):
        parser = argparse.ArgumentParser()
        command.options(parser)
        assert command._settings(parser.parse_args(words)).control == wanted


def test_name_of_a_node_that_is_none() -> None:
    async def run() -> None:
        RosRobot(RosRobotSettings("127.0.0.1", 1, None, "a b"))

    with pytest.raises(RosError, match="invalid name"):
        asyncio.run(run())


def test_refusals_are_tried_again_but_for_a_name_that_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    failures: list[Exception] = [RosError("refused"), PeerError("an odd answer"), OSError("no route"),
                                 RosNameTaken("the node was ended")]
    monkeypatch.setattr("urbihw.ros.robot.bridge.FIRST_PAUSE_S", 0.001)

    class Robot(RosRobot):
        async def _serve(self, pauses: Any) -> None:
            raise failures.pop(0)

    async def run() -> None:
        async with asyncio.timeout(5):
            await Robot(RosRobotSettings("127.0.0.1", 1, None)).run()

    with pytest.raises(RosNameTaken):
        asyncio.run(run())
    assert failures == []
