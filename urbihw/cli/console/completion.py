"""Completion: words of the language, and the names of slots that exist at this moment."""

from __future__ import annotations

import re
from collections.abc import AsyncGenerator, Iterable, Sequence
from typing import Final

from prompt_toolkit.completion import CompleteEvent, Completer, Completion
from prompt_toolkit.document import Document

from urbihw.cli.console.assistant import Assistant, NoAnswer
from urbihw.cli.console.session import ConsoleSession
from urbihw.client.subject import Subject, subject
from urbihw.kernel.stages import WORDS

COMMANDS: Final = ("help",)
_IDENTIFIER: Final = re.compile(r"[A-Za-z_]\w*")


class LiveCompleter(Completer):
    """Completes with names from the server; without an answer, with the words of the language only."""

    def __init__(self, session: ConsoleSession, assistant: Assistant) -> None:
        self._session = session
        self._assistant = assistant

    def get_completions(self, document: Document, complete_event: CompleteEvent) -> Iterable[Completion]:
        """Never called: the completer is asynchronous."""
        return ()

    async def get_completions_async(
        self, document: Document, complete_event: CompleteEvent
    ) -> AsyncGenerator[Completion, None]:
        """Yield the completions at the cursor."""
        wanted = subject(document.text_before_cursor)
        if wanted is None:
            return
        first = not document.text_before_cursor.removesuffix(wanted.prefix).strip()
        for name in candidates(wanted, await self._names(wanted), first=first):
            yield Completion(name, -len(wanted.prefix))

    async def _names(self, wanted: Subject) -> list[str]:
        if not self._session.uid:
            return []
        try:
            return await self._assistant.names(self._session.uid, wanted.path)
        except NoAnswer:
            return []


def candidates(wanted: Subject, names: Sequence[str], *, first: bool) -> list[str]:
    """The names to offer, those that not every object has first; hidden ones (``_x``) only after a typed ``_``.

    ``names`` come from the assistant; ``first``: no path precedes the name.
    """
    border = names.index("") if "" in names else len(names)
    own = set(names[:border])
    offered = own | set(names[border:])
    if not wanted.path:
        offered |= WORDS
        if first:
            offered |= set(COMMANDS)
    hidden = wanted.prefix.startswith("_")
    fitting = [
        name
        for name in offered
        if name.startswith(wanted.prefix) and _IDENTIFIER.fullmatch(name) and (hidden or not name.startswith("_"))
    ]
    return sorted(fitting, key=lambda name: (name not in own, name.lower(), name))
