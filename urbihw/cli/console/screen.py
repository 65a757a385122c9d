"""The prompt: what is typed goes to the server, what the server says appears above it."""

from __future__ import annotations

import asyncio
import contextlib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from prompt_toolkit import PromptSession, print_formatted_text
from prompt_toolkit.auto_suggest import AutoSuggestFromHistory
from prompt_toolkit.formatted_text import AnyFormattedText, FormattedText, merge_formatted_text
from prompt_toolkit.history import FileHistory, History, InMemoryHistory
from prompt_toolkit.input import Input
from prompt_toolkit.key_binding import KeyBindings, KeyPressEvent
from prompt_toolkit.lexers import PygmentsLexer
from prompt_toolkit.output import Output

from urbihw.cli.console.assistant import Assistant, NoAnswer
from urbihw.cli.console.colours import painted, style
from urbihw.cli.console.completion import LiveCompleter
from urbihw.cli.console.help import KEYS, described
from urbihw.cli.console.lexer import UrbiscriptLexer
from urbihw.cli.console.session import Session
from urbihw.cli.console.subject import whole_path
from urbihw.cli.lines import Line
from urbihw.cli.options import EX_UNAVAILABLE, Refused
from urbihw.kernel.stages import unfinished

GATHER: Final = 0.02
"""Seconds in which what the server says is gathered, so that the prompt is drawn anew for all of it at once."""
FIRST_PATIENCE: Final = 10.0
INDENT: Final = "  "


async def talk(
    host: str, port: int, environment: Mapping[str, str], input: Input | None = None, output: Output | None = None
) -> int:
    """Talk until Ctrl-D.  Raises Refused when there is no server to begin with."""
    screen = Screen(host, port, history(environment), input, output)
    await screen.connect()
    return await screen.run()


def history(environment: Mapping[str, str]) -> History:
    """What was typed in former sessions: ``$XDG_STATE_HOME/urbihw/console_history``."""
    home = environment.get("XDG_STATE_HOME") or os.path.join(environment.get("HOME", "~"), ".local", "state")
    path = Path(home).expanduser() / "urbihw" / "console_history"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch(mode=0o600)
    except OSError:
        # No place to keep it: then it lasts as long as the session.
        return InMemoryHistory()
    return FileHistory(str(path))


class Screen:
    """One session at a terminal."""

    def __init__(
        self, host: str, port: int, remembered: History, input: Input | None = None, output: Output | None = None
    ) -> None:
        self._session = Session(host, port, self._heard, self._changed)
        self._assistant = Assistant(host, port)
        self._pieces: list[AnyFormattedText] = []
        self._printing: asyncio.TimerHandle | None = None
        self._connected = asyncio.Event()
        self._lost_once = False
        self._prompt: PromptSession[str] = PromptSession(
            message=self._message,
            multiline=True,
            prompt_continuation=lambda width, line, wrapped: " " * (width - 4) + "... ",
            lexer=PygmentsLexer(UrbiscriptLexer),
            style=style(),
            include_default_pygments_style=False,
            history=remembered,
            auto_suggest=AutoSuggestFromHistory(),
            completer=LiveCompleter(self._session, self._assistant),
            complete_while_typing=False,
            enable_history_search=True,
            key_bindings=self._keys(),
            bottom_toolbar=self._hint,
            input=input,
            output=output,
        )

    # ---------------------------------------------------------------- the connection

    async def connect(self) -> None:
        """Begin to keep the connection.  Raises Refused when there is none to begin with."""
        self._keeping = asyncio.ensure_future(self._session.run())
        await asyncio.wait_for(self._connected.wait(), FIRST_PATIENCE)
        if self._session.state != "connected":
            self._keeping.cancel()
            raise Refused(f"cannot connect to {self._session.name}: {self._session.reason}; is the server running, "
                          "is this its address?", EX_UNAVAILABLE)

    def _changed(self) -> None:
        self._connected.set()
        if self._session.state == "lost" and not self._lost_once:
            self._lost_once = True
            self._note(f"{self._session.name}: {self._session.reason}; trying again")
        elif self._session.state == "connected" and self._lost_once:
            self._lost_once = False
            self._note("connected again; variables and jobs of the former connection are gone")
        self._prompt.app.invalidate()

    # ---------------------------------------------------------------- showing

    def _heard(self, lines: list[Line]) -> None:
        for line in lines:
            self._show(painted(line))

    def _note(self, text: str) -> None:
        self._show(FormattedText([("class:note", f"-- {text}\n")]))

    def _show(self, piece: AnyFormattedText) -> None:
        self._pieces.append(piece)
        if self._printing is None:
            self._printing = asyncio.get_running_loop().call_later(GATHER, self._print)

    def _print(self) -> None:
        self._printing = None
        pieces, self._pieces = self._pieces, []
        if pieces:
            print_formatted_text(merge_formatted_text(pieces), end="", style=style(), output=self._prompt.output,
                                 include_default_pygments_style=False)

    def _message(self) -> FormattedText:
        if self._session.state == "connected":
            return FormattedText([("class:prompt", f"{self._session.name}> ")])
        return FormattedText([("class:prompt.lost", f"{self._session.name} (reconnecting)> ")])

    def _hint(self) -> AnyFormattedText:
        text = self._prompt.default_buffer.text
        if self._session.state != "connected":
            return FormattedText([("class:hint", f"not connected: {self._session.reason}")])
        if text.strip() and not is_command(text) and unfinished(text):
            return FormattedText([("class:hint", "unfinished: end it with ; or , (Esc Enter sends it as it is)")])
        return FormattedText([("class:hint", "Tab completes, help NAME explains, Ctrl-C stops, Ctrl-D leaves")])

    # ---------------------------------------------------------------- typing

    def _keys(self) -> KeyBindings:
        keys = KeyBindings()

        @keys.add("enter")
        def enter(event: KeyPressEvent) -> None:
            buffer = event.current_buffer
            if not buffer.text.strip():
                buffer.reset()
            elif not is_command(buffer.text) and unfinished(buffer.text):
                buffer.insert_text("\n" + INDENT * depth(buffer.document.text_before_cursor))
            elif self._session.state == "connected":
                buffer.validate_and_handle()

        @keys.add("escape", "enter")
        def send_anyway(event: KeyPressEvent) -> None:
            if self._session.state == "connected":
                event.current_buffer.validate_and_handle()

        @keys.add("}")
        def close(event: KeyPressEvent) -> None:
            buffer = event.current_buffer
            line = buffer.document.current_line_before_cursor
            if line.endswith(INDENT) and not line.strip():
                buffer.delete_before_cursor(len(INDENT))
            buffer.insert_text("}")

        @keys.add("c-c")
        def stop(event: KeyPressEvent) -> None:
            if event.current_buffer.text:
                event.current_buffer.reset()
            else:
                event.app.create_background_task(self._interrupt())

        return keys

    async def _interrupt(self) -> None:
        try:
            await self._assistant.interrupt(self._session.uid)
        except NoAnswer as error:
            self._note(f"cannot stop it: {error}")

    async def run(self) -> int:
        """Talk until Ctrl-D."""
        try:
            while True:
                text = await self._prompt.prompt_async()
                if is_command(text):
                    await self._help(text)
                elif not self._session.send(text + "\n"):
                    self._note("not connected: not sent")
        except EOFError:
            return 0
        finally:
            self._keeping.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._keeping
            self._assistant.close()
            self._print()

    async def _help(self, text: str) -> None:
        name = text.strip().partition(" ")[2]
        path = whole_path(name)
        if path is None:
            self._note(KEYS)
            return
        *way, last = path
        try:
            if not isinstance(last, str):
                self._note("help takes a name, such as motors, not one of its members")
                return
            self._show(described(name, await self._assistant.describe(self._session.uid, way, last)))
        except NoAnswer as error:
            self._note(f"no help for {name}: {error}")


def is_command(text: str) -> bool:
    """Whether a text is for the console and not for the server."""
    words = text.strip().rstrip(";").split(maxsplit=1)
    return bool(words) and words[0] == "help" and (len(words) == 1 or whole_path(words[1]) is not None)


def depth(text: str) -> int:
    """How deep the end of a text is in braces, brackets and parentheses; what stands in strings counts, too."""
    return max(0, sum(text.count(sign) for sign in "{[(") - sum(text.count(sign) for sign in "}])"))
