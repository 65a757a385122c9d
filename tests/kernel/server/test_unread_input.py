"""Bytes that a server has not read yet when an era ends belong to it, as do those of a client that sends too much."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.runtime.code import Primitive
from urbihw.kernel.server.connection import MAX_PENDING_INPUT
from urbihw.kernel.server.loop import LoopDriver
from urbihw.kernel.server.tcp import Server
from urbihw.kernel.uobject.arming import Arming


class Client:
    """A client of a server, and what its lobby gets: bytes with their eras."""

    def __init__(self, kernel: Kernel, end: socket.socket) -> None:
        self.end = end
        self.scheduler = kernel.scheduler
        (self.lobby,) = kernel.programs.lobbies
        self.got: list[tuple[bytes, int]] = []
        self.sizes: list[int] = []
        feed = self.lobby.input_handler

        def hear(data: bytes, ordered: int) -> None:
            self.got.append((data[-8:], ordered))
            self.sizes.append(len(data))
            feed(data, ordered)

        self.lobby.input_handler = hear

    async def until(self, done: Callable[[], bool]) -> None:
        """Let the loop run until something is so."""
        async with asyncio.timeout(60):
            while not done():
                await asyncio.sleep(0.001)


def play(path: Path, scene: Callable[[Client], Any]) -> None:
    """Play a scene with a client of a server."""

    async def run() -> None:
        kernel = Kernel()
        kernel.programs.quiet = True
        driver = LoopDriver(kernel.scheduler)

        def open_lobby(remote: str | None, wanted: Callable[[Lobby], None], limit: int) -> Lobby:
            return kernel.open_lobby(remote, wanted, limit)

        server = Server(driver, open_lobby)
        await server.listen_unix(path)
        with socket.socket(socket.AF_UNIX) as end:
            end.connect(str(path))
            async with asyncio.timeout(60):
                while not kernel.programs.lobbies:
                    await asyncio.sleep(0.001)
            await scene(Client(kernel, end))
        await server.close()
        driver.close()
        kernel.close()

    asyncio.run(run())


def test_what_has_arrived_unread_is_of_the_era_in_which_it_arrived(tmp_path: Path) -> None:
    async def scene(client: Client) -> None:
        client.end.sendall(b"1;\n")
        await client.until(lambda: bool(client.got))
        client.end.sendall(b"before;\n")  # the loop does not run between this and the next line
        era = client.scheduler.begin_era()
        client.scheduler.begin_era()
        await client.until(lambda: len(client.got) == 2)
        client.end.sendall(b"behind;\n")
        await client.until(lambda: len(client.got) == 3)
        assert client.got == [(b"1;\n", era - 1), (b"before;\n", era - 1), (b"behind;\n", era + 1)]

    play(tmp_path / "socket", scene)


def test_what_a_client_has_sent_before_it_was_accepted_is_of_that_era(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A neighbour that holds the interpreter lets it wait in the backlog, with its text."""
    path = tmp_path / "socket"
    heard: list[tuple[bytes, int]] = []
    take = Lobby.take_input

    def hear(lobby: Lobby, data: bytes, ordered: int) -> None:
        heard.append((data, ordered))
        take(lobby, data, ordered)

    async def scene(client: Client) -> None:
        monkeypatch.setattr(Lobby, "take_input", hear)
        with socket.socket(socket.AF_UNIX) as other:
            other.connect(str(path))
            other.sendall(b"before;\n")  # the loop does not run between this and the next line
            era = client.scheduler.begin_era()
            await client.until(lambda: len(heard) == 1)
            other.sendall(b"behind;\n")
            await client.until(lambda: len(heard) == 2)
        assert heard == [(b"before;\n", era - 1), (b"behind;\n", era)]

    play(path, scene)


@pytest.mark.parametrize(("text", "ordered_with_it"), [("frees();", True), ("detach({ frees() });", False)])
def test_what_has_arrived_behind_a_release_is_ordered_with_it(
    tmp_path: Path, text: str, ordered_with_it: bool
) -> None:
    async def scene(client: Client) -> None:
        world = client.lobby.world
        arming = Arming(world, "robot")

        def free(this: Any) -> Any:
            client.end.sendall(b"behind;\n")  # the loop does not run between this and the release
            arming.release()
            arming.order_anew()
            return world.void

        client.lobby.slots["frees"] = Primitive(world, "frees", free, 0, 0)
        client.end.sendall(text.encode())
        await client.until(lambda: len(client.got) == 2)
        assert client.got[1] == (b"behind;\n", client.scheduler.era - (not ordered_with_it))
        client.end.sendall(b"then;\n")
        await client.until(lambda: len(client.got) == 3)
        assert client.got[2] == (b"then;\n", client.scheduler.era)

    play(tmp_path / "socket", scene)


def test_what_a_client_has_sent_that_is_not_read_is_of_the_era_in_which_it_sent_it(tmp_path: Path) -> None:
    async def scene(client: Client) -> None:
        line = b"/*" + b"x" * 4000 + b"*/ 1;\n"
        gate = b"var Global.go = Event.new|; waituntil (go?);\n"
        text = gate + line * (3 * MAX_PENDING_INPUT // len(line))
        rest = memoryview(text)
        client.end.setblocking(False)
        began = client.scheduler.era

        def send_all() -> bool:
            nonlocal rest
            try:
                rest = rest[client.end.send(rest) :]
            except BlockingIOError:
                return client.lobby.shell.waiting > MAX_PENDING_INPUT
            return not rest

        await client.until(send_all)
        sent = len(text) - len(rest)
        assert sent > sum(client.sizes)
        client.scheduler.begin_era()
        with socket.socket(socket.AF_UNIX) as other:
            other.connect(client.end.getpeername())
            other.sendall(b"go!;\n")
            await client.until(lambda: send_all() and not rest and not client.lobby.shell.waiting)
        eras = [ordered for _, ordered in client.got]
        assert eras == sorted(eras)
        assert sum(client.sizes[: eras.count(began)]) >= sent
        # It has caught up: what comes now is new.
        client.end.send(b"8;\n")
        await client.until(lambda: client.got[-1][0].endswith(b"8;\n"))
        client.end.send(b"2;\n")
        await client.until(lambda: client.got[-1] == (b"2;\n", began + 1))

    play(tmp_path / "socket", scene)
