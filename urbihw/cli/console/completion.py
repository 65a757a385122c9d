"""Completion: words of the language, and the names of slots that exist at this moment."""

from __future__ import annotations

from collections.abc import AsyncGenerator, Iterable, Sequence
from typing import Final

from prompt_toolkit.completion import CompleteEvent, Completer, Completion
from prompt_toolkit.document import Document

from urbihw.cli.console.session import ConsoleSession
from urbihw.client.assistant import Assistant, KnownName, NoAnswer, fitting
from urbihw.client.subject import Subject, subject
from urbihw.kernel.stages import WORDS

COMMANDS: Final = ("help",)
LANGUAGE: Final = "3"
"""The rank of the words of the language: they stand with what every object has."""


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
        for each in candidates(wanted, await self._names(wanted), first=first):
            yield Completion(each.name, -len(wanted.prefix), display_meta=each.meaning)

    async def _names(self, wanted: Subject) -> list[KnownName]:
        if not self._session.uid:
            return []
        try:
            return await self._assistant.names(self._session.uid, wanted.path, wanted.prefix)
        except NoAnswer:
            return []


def candidates(wanted: Subject, names: Sequence[KnownName], *, first: bool) -> list[KnownName]:
    """The names to offer, and the words of the language.

    ``names`` come from the assistant; ``first``: no path precedes the name.
    """
    offered = {each.name: each for each in names}
    if not wanted.path:
        for word in (*WORDS, *(COMMANDS if first else ())):
            offered.setdefault(word, KnownName(word, LANGUAGE, ""))
    return fitting(wanted, offered.values())
