"""LeRobot itself records ten seconds of two simulated SO-101s and a camera: ``make lerobot``.

It runs in LeRobot's environment, by LeRobot's command, and prints how many of the samples are in the dataset.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Final

import urbihw

RATE_HZ: Final = 30
START_S: Final = 60.0
CAMERA: Final = 'var Global.photo = Binary.new("rgb 64 48", "")|; var Global.shade = 0|;'
SHOOT: Final = (
    'every (30ms) { shade = (shade + 1) % 8 | Global.photo = Binary.new("rgb 64 48", "07AHOVaz"[shade] * 9216) },'
)
SWING: Final = "shoulder_pan.load = 1|; shoulder_pan.val = 0 sin:4s ampli:30deg,"


def main() -> int:
    """Record; returns 0 when no sample is missing."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0)
    seconds = parser.parse_args().seconds
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        folder = Path(name)
        follower, leader = (_served(folder / role, stack) for role in ("follower", "leader"))
        # The picture and the movement by hand, which a simulated arm does not have by itself.
        for address, text in ((follower, CAMERA), (leader, SWING)):
            robot = stack.enter_context(urbihw.connect(address))
            robot.run(text)
            if address == follower:
                robot.run(SHOOT)
        size = "width: 64, height: 48, fps: 30"
        camera = f"{{front: {{type: urbihw_camera, address: '{follower}', slot: photo, {size}}}}}"
        subprocess.run((
            Path(sys.executable).with_name("lerobot-record"), "--robot.type=urbihw", f"--robot.address={follower}",
            "--robot.id=a", f"--robot.cameras={camera}", "--teleop.type=urbihw_leader", f"--teleop.address={leader}",
            "--teleop.id=b", "--dataset.repo_id=urbihw/test", f"--dataset.root={folder / 'data'}",
            "--dataset.single_task=wave", "--dataset.num_episodes=1", f"--dataset.episode_time_s={seconds:g}",
            f"--dataset.fps={RATE_HZ}", "--dataset.push_to_hub=false", "--play_sounds=false",
        ), check=True)  # fmt: skip
        info = json.loads((folder / "data" / "meta" / "info.json").read_text())
    wanted = round(seconds * RATE_HZ)
    print(f"{info['total_frames']} of {wanted} samples, {info['codebase_version']}: {', '.join(info['features'])}")
    return 0 if info["total_frames"] >= wanted - 1 else 1


def _served(folder: Path, stack: ExitStack) -> str:
    """A simulated arm and its daemon; the address."""
    folder.mkdir()
    file = folder / "port"
    command = (sys.executable, "-m", "urbihw.cli.main", "serve", "--platform", "so101", "--fake", "--quiet")
    daemon = subprocess.Popen((*command, "--port", "0", "--port-file", str(file)), cwd=folder)
    stack.callback(daemon.wait)
    stack.callback(daemon.terminate)
    end = time.monotonic() + START_S
    while not (file.exists() and file.read_text().strip()):
        if time.monotonic() > end:
            raise TimeoutError("the daemon does not start")
        time.sleep(0.1)
    return f"127.0.0.1:{file.read_text().strip()}"


if __name__ == "__main__":
    sys.exit(main())
