"""An assistant's program that is killed, and a server for assistants that is held, while a Pioneer drives for them."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from faults_lab import ROOT, case_of, wait_for
from moving_robots import RIGS

pytestmark = pytest.mark.e2e

ASSISTANT = """
import asyncio, sys
from mcp import Client, StdioServerParameters
async def main():
    server = StdioServerParameters(command=sys.executable, args=["-m", "urbihw.cli.main", "mcp", *sys.argv[1:]])
    async with Client(server) as client:
        seen = await client.call_tool("look", {"slots": ["robot.position"]})
        print(seen.content[0].text.replace("\\n", " "), flush=True)
        print((await client.call_tool("go", {"x": 5, "y": 0})).content[0].text, flush=True)
        sys.stdin.readline()
asyncio.run(main())
"""


def test_the_base_of_a_killed_assistant_and_of_a_held_server_stands(tmp_path: Path) -> None:
    (rig,) = (rig for rig in RIGS if rig.platform == "p3dx")
    with case_of(rig) as case, contextlib.ExitStack() as stack:
        options = ("-H", "127.0.0.1", "-P", str(case.daemon.port), "--role", "drive")

        def assistant() -> subprocess.Popen[str]:
            command = (sys.executable, "-c", ASSISTANT, *options)
            made = subprocess.Popen(
                command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True
            )
            stack.enter_context(made)
            stack.callback(made.kill)
            assert made.stdout is not None
            assert "\"x\": " in (seen := made.stdout.readline()), seen
            wait_for(lambda: case.watcher.speed() > rig.moving, "the base to drive")
            return made

        killed = assistant()
        os.kill(killed.pid, signal.SIGKILL)
        wait_for(lambda: case.watcher.speed() <= rig.rest, "the base to stand")

        held = assistant()
        (server,) = map(int, Path(f"/proc/{held.pid}/task/{held.pid}/children").read_text().split())
        os.kill(server, signal.SIGSTOP)
        wait_for(lambda: case.watcher.speed() <= rig.rest, "the base to stand")
        assert "has sent nothing for 1 s (lobby.lease)" in case.daemon.log()
        os.kill(server, signal.SIGCONT)
        assert held.stdout is not None
        assert "Error executing tool go: " in held.stdout.readline()
        assert "mcp (assistant) (127.0.0.1): drives to 5, 0 ahead" in case.daemon.log()
