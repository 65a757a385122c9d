"""The process around a kernel: signals, ports, the port file, and the end."""

from __future__ import annotations

import asyncio
import os
import signal
import socket
import threading
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest

from urbihw.kernel.process import END_SIGNALS, KernelProcess

TIMEOUT_S = 20.0


def play(scene: Callable[[KernelProcess], Awaitable[None]]) -> None:
    """Run a scene in a process with its signals, and end it in order, which leaves all handlers as they were."""

    async def run() -> None:
        process = KernelProcess()
        process.install_signals()
        try:
            await asyncio.wait_for(scene(process), TIMEOUT_S)
        finally:
            for _ in range(2):
                await process.close()
                process.restore_signals()

    before = [signal.getsignal(number) for number in END_SIGNALS]
    asyncio.run(run())
    after = [signal.getsignal(number) for number in END_SIGNALS]
    assert before == after and signal.set_wakeup_fd(-1) == -1


@pytest.mark.parametrize("number", END_SIGNALS)
@pytest.mark.parametrize("booted", [False, True], ids=["before the kernel", "with a kernel"])
def test_a_signal_ends_the_process_in_order(number: int, booted: bool) -> None:
    async def scene(process: KernelProcess) -> None:
        if booted:
            process.boot(fast=True)
        os.kill(os.getpid(), number)
        await process.stopped

    play(scene)


def test_a_signal_while_the_kernel_is_made_is_not_forgotten() -> None:
    async def scene(process: KernelProcess) -> None:
        os.kill(os.getpid(), signal.SIGTERM)
        process.boot(fast=True)
        await process.stopped

    play(scene)


def test_a_program_ends_it_with_its_exit_status() -> None:
    async def scene(process: KernelProcess) -> None:
        assert process.exit_status is None
        process.boot(fast=True)
        assert (await process.run_text("1 + nosuch", "a program")).startswith("a program:1.5-10: lookup failed: nosuch")
        assert await process.run_until_stopped(process.run_text("System._exit(7)", "a program")) is None
        assert process.exit_status == 7

    play(scene)


def test_a_text_that_ends_after_the_process_was_told_to_is_no_failure(caplog: pytest.LogCaptureFixture) -> None:
    async def scene(process: KernelProcess) -> None:
        process.boot(fast=True)
        assert await process.run_text("var Global.go = Event.new", "a program") == ""
        start = asyncio.ensure_future(process.run_until_stopped(process.run_text("waituntil(go?)", "a library")))
        await asyncio.sleep(0)
        process.stop()
        assert await start is None
        assert await process.run_text("go!", "a program") == ""

    play(scene)
    assert [record.getMessage() for record in caplog.records] == []


def test_work_is_cancelled_when_the_process_is_to_end() -> None:
    left: list[str] = []

    async def work(process: KernelProcess, fails: bool) -> str:
        try:
            process.stop()
            await asyncio.sleep(TIMEOUT_S)
        finally:
            left.append("left")
            if fails:
                raise OSError("while it was cancelled")
        return "done"

    async def scene(process: KernelProcess) -> None:
        async def answer() -> int:
            return 42

        assert await process.run_until_stopped(answer()) == 42
        assert await process.run_until_stopped(work(process, False)) is None
        assert await process.run_until_stopped(work(process, True)) is None

    play(scene)
    assert left == ["left", "left"]


def test_clients_come_in_by_port_and_path_and_the_port_is_in_the_file(tmp_path: Path) -> None:
    path, port_file = tmp_path / "urbi.socket", tmp_path / "port"

    async def scene(process: KernelProcess) -> None:
        assert process.bind("127.0.0.1", 0) == ["127.0.0.1"]
        process.bind_unix(path)
        process.boot().programs.quiet = True
        with socket.socket() as early, pytest.raises(ConnectionRefusedError):
            early.connect(("127.0.0.1", process.bound_port))
        process.listen()
        process.write_port_file(port_file)
        assert port_file.read_text() == f"{process.port}\n"
        for reader, writer in (
            await asyncio.open_connection("127.0.0.1", process.port),
            await asyncio.open_unix_connection(str(path)),
        ):
            writer.write(b"6 * 7;\n")
            assert (await reader.readline()).endswith(b"] 42\n")
            writer.close()

    play(scene)
    assert not path.exists() and not port_file.exists()


def test_a_port_file_of_another_server_or_a_device_stays(tmp_path: Path) -> None:
    port_file, link = tmp_path / "port", tmp_path / "link"
    link.symlink_to("/dev/null")

    async def scene(process: KernelProcess) -> None:
        process.boot(fast=True)
        process.write_port_file(port_file)
        port_file.write_text("4711\n")

    async def into_a_device(process: KernelProcess) -> None:
        process.boot(fast=True)
        process.write_port_file(link)

    play(scene)
    play(into_a_device)
    assert port_file.read_text() == "4711\n" and link.is_symlink()


def test_sockets_that_were_bound_only_are_freed(tmp_path: Path) -> None:
    path = tmp_path / "urbi.socket"

    async def scene(process: KernelProcess) -> None:
        process.bind("127.0.0.1", 0)
        process.bind_unix(path)

    play(scene)
    assert not path.exists()


def test_outside_the_main_thread_signals_are_left_alone() -> None:
    former = signal.getsignal(signal.SIGTERM)
    seen: list[object] = []

    async def run() -> None:
        process = KernelProcess()
        process.install_signals()
        process.boot(fast=True)
        seen.append(signal.getsignal(signal.SIGTERM))
        await process.close()
        process.restore_signals()

    thread = threading.Thread(target=lambda: asyncio.run(run()))
    thread.start()
    thread.join(TIMEOUT_S)
    assert seen == [former]
