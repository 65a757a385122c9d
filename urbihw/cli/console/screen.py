"""The prompt: the input goes to the server, the server's output appears above the prompt."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import textwrap
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Final

from prompt_toolkit import PromptSession
from prompt_toolkit.auto_suggest import AutoSuggestFromHistory
from prompt_toolkit.buffer import Buffer
from prompt_toolkit.formatted_text import AnyFormattedText, FormattedText
from prompt_toolkit.history import FileHistory, History, InMemoryHistory
from prompt_toolkit.key_binding import KeyBindings, KeyPressEvent
from prompt_toolkit.lexers import PygmentsLexer

from urbihw.cli.console.colours import STYLE, highlighted, painted
from urbihw.cli.console.completion import LiveCompleter
from urbihw.cli.console.help import described, keys_text
from urbihw.cli.console.lexer import UrbiscriptLexer
from urbihw.cli.console.prompt_printer import PromptPrinter
from urbihw.cli.console.session import ConsoleSession
from urbihw.cli.options import CliRefused
from urbihw.client.assistant import Assistant, NoAnswer
from urbihw.client.credentials import Credentials
from urbihw.client.lines import Line
from urbihw.client.subject import Step, open_call, whole_path
from urbihw.client.where import Where
from urbihw.exitcodes import NO_SERVER
from urbihw.kernel.stages import dump, unfinished

FIRST_TIMEOUT_S: Final = 10.0
INDENT: Final = "  "


async def run_session(where: Where, who: Credentials, environment: Mapping[str, str]) -> int:
    """Run the console until Ctrl-D or ``quit;``.  Raises CliRefused if the first connection fails."""
    screen = Screen(where, who, history(environment))
    await screen.connect()
    return await screen.run()


def history(environment: Mapping[str, str]) -> History:
    """The input of former sessions: ``$XDG_STATE_HOME/urbihw/console_history``."""
    home = environment.get("XDG_STATE_HOME") or os.path.join(environment.get("HOME", "~"), ".local", "state")
    path = Path(home).expanduser() / "urbihw" / "console_history"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch(mode=0o600)
    except OSError:
        # The folder cannot be written: the history lasts for this session only.
        return InMemoryHistory()
    return FileHistory(str(path))


class Screen:
    """One session at a terminal."""

    def __init__(self, where: Where, who: Credentials, remembered: History) -> None:
        self._session = ConsoleSession(where, who, self._heard, self._changed)
        self._assistant = Assistant(where, who)
        # Computed with each key, and again for Enter.
        self._unfinished = lru_cache(maxsize=2)(unfinished)
        self._connected = asyncio.Event()
        self._lost_once = self._leaves = False
        self._prompt: PromptSession[str] = PromptSession(
            message=self._message,
            multiline=True,
            prompt_continuation=lambda width, line, wrapped: continuation(width),
            lexer=PygmentsLexer(UrbiscriptLexer),
            style=STYLE,
            include_default_pygments_style=False,
            history=remembered,
            auto_suggest=AutoSuggestFromHistory(),
            completer=LiveCompleter(self._session, self._assistant),
            complete_while_typing=False,
            enable_history_search=True,
            key_bindings=self._keys(),
            bottom_toolbar=self._hint,
        )
        self._prompt_printer = PromptPrinter(self._prompt.app, STYLE)
        self._call: tuple[tuple[Step, ...], str] | None = None
        """The function whose arguments are typed, and what its help says of them."""
        self._call_hint = ""
        self._prompt.default_buffer.on_text_changed += self._look_at_call
        self._prompt.default_buffer.on_cursor_position_changed += self._look_at_call

    # ---------------------------------------------------------------- the connection

    async def connect(self) -> None:
        """Open the connection and keep it open.  Raises CliRefused if the first attempt fails."""
        self._keeping = asyncio.ensure_future(self._session.run())
        await asyncio.wait_for(self._connected.wait(), FIRST_TIMEOUT_S)
        if self._session.state != "connected":
            self._keeping.cancel()
            if self._session.state == "denied":
                raise CliRefused(self._session.reason)
            raise CliRefused(f"cannot connect to {self._session.name}: {self._session.reason}; is the server running, "
                             "is this its address?", NO_SERVER)

    def _changed(self) -> None:
        self._connected.set()
        if self._session.state == "lost" and self._leaves:
            self._keeping.cancel()
            self._prompt.app.exit(exception=EOFError)
            return
        if self._session.state == "lost" and not self._lost_once:
            self._lost_once = True
            self._note(f"{self._session.name}: {self._session.reason}; trying again")
        elif self._session.state == "denied":
            self._note(self._session.reason)
        elif self._session.state == "connected" and self._lost_once:
            self._lost_once = False
            self._note("connected again; variables and jobs of the former connection are gone")
        self._prompt.app.invalidate()

    # ---------------------------------------------------------------- showing

    def _heard(self, line: Line) -> None:
        self._prompt_printer.show(painted(line))

    def _note(self, text: str) -> None:
        self._prompt_printer.show(FormattedText([("class:note", f"-- {text}\n")]))

    def _message(self) -> FormattedText:
        kind = "class:prompt" if self._state == "connected" else "class:prompt.lost"
        return FormattedText([(kind, self._name)])

    @property
    def _state(self) -> str:
        """The state of the connection; its wanted end is not shown."""
        return "connected" if self._leaves else self._session.state

    @property
    def _name(self) -> str:
        how = {"connected": "", "denied": " (denied)"}.get(self._state, " (reconnecting)")
        return f"{self._session.name}{how}> "

    @property
    def _columns(self) -> int:
        return self._prompt.app.output.get_size().columns

    def _look_at_call(self, buffer: Buffer) -> None:
        """The text has changed: ask for the arguments of the function in whose parentheses the cursor stands."""
        call = open_call(buffer.document.text_before_cursor)
        if call != self._call:
            self._call, self._call_hint = call, ""
            if call is not None and self._session.uid:
                self._prompt.app.create_background_task(self._tell_arguments(call))

    async def _tell_arguments(self, call: tuple[tuple[Step, ...], str]) -> None:
        with contextlib.suppress(NoAnswer):
            arguments, text = await self._assistant.call(self._session.uid, *call)
            if call == self._call and (arguments or text):
                how, said = f"{call[1]}{arguments or '()'}", text.partition("\n")[0]
                self._call_hint = said if said.startswith(how) else f"{how}: {said}".removesuffix(": ")
                self._prompt.app.invalidate()

    def _hint(self) -> AnyFormattedText:
        text = self._prompt.default_buffer.text
        if self._call_hint:
            hint = textwrap.shorten(self._call_hint, self._columns - 1, placeholder=" ...")
            return FormattedText([("class:hint", hint)])
        if self._state != "connected":
            return FormattedText([("class:hint", f"not connected: {self._session.reason}")])
        if text.strip() and asked_help(text) is None and self._unfinished(text):
            return FormattedText([("class:hint", "unfinished: end it with ; or , (an empty line adds the ;)")])
        return FormattedText([("class:hint", "Tab completes, NAME? explains, Ctrl-C stops, Ctrl-D leaves")])

    # ---------------------------------------------------------------- typing

    def _keys(self) -> KeyBindings:
        keys = KeyBindings()

        @keys.add("enter")
        def enter(event: KeyPressEvent) -> None:
            buffer = event.current_buffer
            if not buffer.text.strip():
                buffer.reset()
            elif asked_help(buffer.text) is not None or not self._unfinished(buffer.text):
                self._submit(buffer)
            elif buffer.document.is_cursor_at_the_end and lacks_separator(buffer.text):
                buffer.text = buffer.text.rstrip() + ";"
                self._submit(buffer)
            else:
                buffer.insert_text("\n" + INDENT * depth(buffer.document.text_before_cursor))

        @keys.add("escape", "enter")
        def send_anyway(event: KeyPressEvent) -> None:
            self._submit(event.current_buffer)

        @keys.add("}")
        def close(event: KeyPressEvent) -> None:
            buffer = event.current_buffer
            line = buffer.document.current_line_before_cursor
            if line.endswith(INDENT) and not line.strip():
                buffer.delete_before_cursor(len(INDENT))
            buffer.insert_text("}")

        @keys.add("c-c")
        @keys.add("<sigint>")
        def stop(event: KeyPressEvent) -> None:
            if event.current_buffer.text:
                event.current_buffer.reset()
            else:
                event.app.create_background_task(self._interrupt())

        return keys

    def _submit(self, buffer: Buffer) -> None:
        """Send the input; without a connection it stays in the prompt."""
        text = buffer.text
        if self._session.state != "connected":
            return
        buffer.reset(append_to_history=True)
        # The same prompt goes on: between two prompts the terminal's own settings would process the keys.
        self._prompt_printer.show(FormattedText([*self._message(), *highlighted(text, continuation(len(self._name)))]))
        self._prompt_printer.flush()
        if asked_help(text) is not None:
            self._prompt.app.create_background_task(self._help(text))
        else:
            self._leaves = ends_session(text)
            self._session.send(text + "\n")

    async def _interrupt(self) -> None:
        try:
            await self._assistant.interrupt(self._session.uid)
        except NoAnswer as error:
            self._note(f"cannot stop it: {error}")

    async def run(self) -> int:
        """Run the prompt until Ctrl-D, ``quit;``, or SIGTERM, after which the terminal settings must be restored."""
        loop = asyncio.get_running_loop()
        loop.add_signal_handler(signal.SIGTERM, lambda: self._prompt.app.exit(exception=EOFError))
        try:
            await self._prompt.prompt_async()
        except EOFError:
            pass
        finally:
            loop.remove_signal_handler(signal.SIGTERM)
            self._keeping.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._keeping
            self._assistant.close()
            self._prompt_printer.flush()
        return 0

    async def _help(self, text: str) -> None:
        name = asked_help(text) or ""
        path = whole_path(name)
        if path is None:
            self._note(keys_text(self._columns))
            return
        *way, last = path
        try:
            if not isinstance(last, str):
                self._note("help takes a name, such as motors, not one of its members")
                return
            told = await self._assistant.describe(self._session.uid, way, last)
            self._prompt_printer.show(described(name, told, self._columns))
        except NoAnswer as error:
            self._note(f"no help for {name}: {error}")


def asked_help(text: str) -> str | None:
    """What a text asks help for, by ``help NAME`` or ``NAME?``: a path, or "" for the console itself; None for a text
    that is for the server."""
    typed = text.strip()
    words = typed.rstrip(";").split(maxsplit=1)
    if words[:1] == ["help"]:
        name = "".join(words[1:])
    elif typed.endswith("?"):
        name = typed.removesuffix("?").rstrip()
    else:
        return None
    return name if not name or whole_path(name) is not None else None


def ends_session(text: str) -> bool:
    """Whether the last statement of a text ends the connection, so that its end is no loss."""
    return text.rstrip().rstrip(";,").rpartition(";")[2].strip() in ("quit", "lobby.quit")


def lacks_separator(text: str) -> bool:
    """Whether a text ends with an empty line and is a complete statement except for its ``;``."""
    if text.rpartition("\n")[1:] != ("\n", "") or unfinished(text.rstrip() + ";"):
        return False
    _, problems = dump(text.rstrip() + ";", "ast")
    return not problems


def depth(text: str) -> int:
    """The nesting depth of braces, brackets and parentheses at the end of a text; those in strings count, too."""
    return max(0, sum(text.count(sign) for sign in "{[(") - sum(text.count(sign) for sign in "}])"))


def continuation(width: int) -> str:
    """The prompt of a continuation line, below a prompt of the given width."""
    return "... ".rjust(width)
