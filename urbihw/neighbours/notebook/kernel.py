"""The kernel: messages of Jupyter, by the package ipykernel.

A cell is a statement under the tag ``cell``, so that an interrupt stops it, with what it has in the background.  Output
belongs to the newest cell: ipykernel keeps the message that is answered in a variable of the context, which the task
that reads from the daemon does not have, so it is kept here, too.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
from typing import Any, Final

from ipykernel.kernelapp import IPKernelApp
from ipykernel.kernelbase import Kernel

from urbihw.client import aio
from urbihw.client.aio import AsyncRobot
from urbihw.client.assistant import Assistant, NoAnswer, fitting
from urbihw.client.errors import ClientError, UrbiError
from urbihw.client.live_plot import plot_svg
from urbihw.client.robot import credentials_of, split_address
from urbihw.client.session import Message
from urbihw.client.streams import Sample
from urbihw.client.subject import subject
from urbihw.client.where import where_is
from urbihw.neighbours.notebook.cells import PlotOrder, completeness, described, plot_order, shown
from urbihw.neighbours.notebook.spec import ADDRESS

TAG: Final = "cell"
DEFAULT_PORT: Final = 54000
CONNECT_TIMEOUT_S: Final = 10.0
STOP_TIMEOUT_S: Final = 2.0
PLOT_HZ: Final = 20.0


class UrbiscriptKernel(Kernel):
    """A notebook before a daemon, whose address is in the environment; the connection is made by the first cell."""

    implementation = "urbihw"
    implementation_version = "1"
    banner = "urbiscript, run by the daemon of a robot"
    language_info: dict[str, Any] = {
        "name": "urbiscript", "version": "2.3", "mimetype": "text/x-urbiscript", "file_extension": ".u",
        "pygments_lexer": "urbiscript", "codemirror_mode": "clike",
    }  # fmt: skip

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)  # type: ignore[no-untyped-call]
        host, port = split_address(os.environ.get(ADDRESS) or "127.0.0.1", DEFAULT_PORT)
        self._host, self._port = host, port
        self._assistant = Assistant(where_is(host, port, None), credentials_of("", None, False))
        self._robot: AsyncRobot | None = None
        self._uid = ""
        self._loop: asyncio.AbstractEventLoop | None = None
        self._running: asyncio.Task[Any] | None = None
        self._is_interrupted = False
        self._cell: Any = None

    async def _link(self) -> AsyncRobot:
        """The connection to the daemon.  Raises ClientError."""
        if self._robot is None or not self._robot.connected:
            self._loop = asyncio.get_running_loop()
            self._robot = await aio.connect(
                self._host, self._port, timeout=CONNECT_TIMEOUT_S, reconnect=False, on_message=self._hear
            )
            self._uid = str(await self._robot.run('lobby.introduce("notebook")|; lobby.uid', timeout=CONNECT_TIMEOUT_S))
        return self._robot

    def _hear(self, message: Message) -> None:
        self._send("stream", {"name": "stderr" if message.is_error else "stdout", "text": f"{message.text}\n"})

    def _send(self, kind: str, content: dict[str, Any]) -> None:
        """Send output of the newest cell."""
        if self.session is not None:
            self.session.send(self.iopub_socket, kind, content, parent=self._cell)

    # ---------------------------------------------------------------- cells

    async def do_execute(
        self, code: str, silent: bool, store_history: bool = True, user_expressions: Any = None,
        allow_stdin: bool = False, **_: Any,
    ) -> dict[str, Any]:  # fmt: skip
        """Run a cell."""
        self._cell = self.get_parent("shell")  # type: ignore[no-untyped-call]
        self._is_interrupted = False
        told = {"execution_count": self.execution_count, "payload": [], "user_expressions": {}}
        try:
            order = plot_order(code)
            self._running = asyncio.ensure_future(self._carry_out(code) if order is None else self._plot(order))
            value = await self._running
        except (ClientError, ValueError, asyncio.CancelledError) as error:
            return {**told, **self._failed(error)}
        finally:
            self._running = None
        if self._is_interrupted:
            return {**told, **self._failed(asyncio.CancelledError())}
        if value is not None and not silent:
            result = {"execution_count": self.execution_count, "data": shown(value), "metadata": {}}
            self._send("execute_result", result)
        return {**told, "status": "ok"}

    async def _carry_out(self, code: str) -> Any:
        return await (await self._link()).run(code, tag=TAG) if code.strip() else None

    async def _plot(self, order: PlotOrder) -> None:
        """Follow slots for some seconds, and show them."""
        samples: list[Sample] = []
        async with (await self._link()).watch(*order.slots, hz=PLOT_HZ, timeout=CONNECT_TIMEOUT_S) as watch:
            async for sample in watch:
                samples.append(sample)
                if sample.time - samples[0].time >= order.seconds:
                    break
        picture = plot_svg(order.slots, samples, order.seconds)
        data = {"image/svg+xml": picture, "text/plain": f"{len(samples)} samples of {', '.join(order.slots)}"}
        self._send("display_data", {"data": data, "metadata": {}})

    def _failed(self, error: BaseException) -> dict[str, Any]:
        """The end of a cell that an error or an interrupt ends."""
        name, text = type(error).__name__, str(error)
        if isinstance(error, asyncio.CancelledError):
            name, text = "Interrupted", "the cell was stopped, with what it had in the background"
        elif isinstance(error, UrbiError):
            text = str(error)
        told = {"ename": name, "evalue": text, "traceback": [f"{name}: {text}"]}
        self._send("error", told)
        return {"status": "error", **told}

    async def interrupt_request(self, stream: Any, ident: Any, parent: Any) -> None:
        """Stop the cell, and what cells have in the background.  Called in the thread of the control channel."""
        if self._loop is not None and self._robot is not None:
            stopping = asyncio.run_coroutine_threadsafe(self._stop(), self._loop)
            await asyncio.wrap_future(stopping)
        if self.session is not None:
            self.session.send(stream, "interrupt_reply", {"status": "ok"}, parent, ident=ident)

    async def _stop(self) -> None:
        running, self._is_interrupted = self._running, True
        with contextlib.suppress(ClientError, TimeoutError):
            if self._robot is not None:
                async with asyncio.timeout(STOP_TIMEOUT_S):
                    await self._robot.stop(TAG)
        if running is not None:
            running.cancel()

    async def do_shutdown(self, restart: bool) -> dict[str, Any]:
        """End the connection, and with it what cells have in the background."""
        self._assistant.close()
        if self._robot is not None:
            await self._robot.close()
        return {"status": "ok", "restart": restart}

    # ---------------------------------------------------------------- help

    async def do_is_complete(self, code: str) -> dict[str, Any]:
        """Whether Enter begins a new line; no daemon is asked."""
        status = completeness(code)
        return {"status": status, "indent": "  "} if status == "incomplete" else {"status": status}

    async def do_complete(self, code: str, cursor_pos: int) -> dict[str, Any]:
        """The names of slots before the cursor; no function of the robot is called."""
        wanted = subject(code[:cursor_pos])
        names: list[str] = []
        if wanted is not None:
            with contextlib.suppress(ClientError, NoAnswer):
                await self._link()
                known = await self._assistant.names(self._uid, wanted.path, wanted.prefix)
                names = [each.name for each in fitting(wanted, known)]
        start = cursor_pos - len(wanted.prefix if wanted is not None else "")
        return {"status": "ok", "matches": names, "cursor_start": start, "cursor_end": cursor_pos, "metadata": {}}

    async def do_inspect(
        self, code: str, cursor_pos: int, detail_level: int = 0, omit_sections: Any = ()
    ) -> dict[str, Any]:
        """The help on the name at the cursor."""
        end = cursor_pos
        while end < len(code) and (code[end].isalnum() or code[end] == "_"):
            end += 1
        wanted, text = subject(code[:end]), ""
        if wanted is not None and wanted.prefix:
            with contextlib.suppress(ClientError, NoAnswer):
                await self._link()
                told = await self._assistant.describe(self._uid, wanted.path, wanted.prefix)
                text = described(wanted.prefix, told)
        return {"status": "ok", "found": bool(text), "data": {"text/plain": text} if text else {}, "metadata": {}}


def main() -> None:
    """Serve the notebook that has started this program."""
    IPKernelApp.launch_instance(kernel_class=UrbiscriptKernel)
