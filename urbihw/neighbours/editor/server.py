"""The language server: messages of the Language Server Protocol, by the package pygls.

Errors are those of our parser, and need no robot.  Names and help come from a live one, if there is: no function of it
is called, and nothing is written.
"""

from __future__ import annotations

from collections import deque
from typing import Final

from lsprotocol import types
from pygls.lsp.server import LanguageServer

from urbihw.client.aio import AsyncRobot
from urbihw.client.aio_connection import AsyncConnection
from urbihw.client.assistant import Assistant, KnownName, NoAnswer, fitting
from urbihw.client.credentials import Credentials
from urbihw.client.errors import ClientError
from urbihw.client.subject import Subject, subject
from urbihw.client.where import Where
from urbihw.neighbours.editor.problems import problems_of
from urbihw.neighbours.editor.textmate import words

TIMEOUT_S: Final = 2.0
_LANGUAGE: Final = "3"
"""The rank of the words of the language: behind what the robot has."""


class RobotNames:
    """The names and descriptions of a robot; nothing while it does not answer."""

    def __init__(self, where: Where, credentials: Credentials) -> None:
        self._connection = AsyncConnection(where, credentials, TIMEOUT_S, True, lambda line, at: None)
        self._assistant = Assistant(where, credentials)
        self._uid = ""
        self._connects = 0

    async def _lobby(self) -> str:
        """The lobby in whose eyes names are looked up.  Raises ClientError."""
        if not self._uid or self._connects != self._connection.core.connects or not self._connection.connected:
            robot = AsyncRobot(self._connection, deque())
            self._uid = str(await robot.run('lobby.introduce("editor")|; lobby.uid', timeout=TIMEOUT_S))
            self._connects = self._connection.core.connects
        return self._uid

    async def names(self, wanted: Subject) -> list[KnownName]:
        """The slots that may be typed."""
        try:
            return await self._assistant.names(await self._lobby(), wanted.path, wanted.prefix)
        except (ClientError, NoAnswer):
            return []

    async def meaning(self, wanted: Subject) -> str:
        """What a slot is, "" if that is not known."""
        try:
            told = await self._assistant.describe(await self._lobby(), wanted.path, wanted.prefix)
        except (ClientError, NoAnswer):
            return ""
        return "\n\n".join(filter(None, (f"{wanted.prefix}: {told.type}", told.text)))


def make_server(robot: RobotNames | None) -> LanguageServer:
    """The server, before a robot or none."""
    server = LanguageServer("urbiscript", "1", text_document_sync_kind=types.TextDocumentSyncKind.Full)

    def tell(uri: str) -> None:
        text = server.workspace.get_text_document(uri).source
        server.text_document_publish_diagnostics(types.PublishDiagnosticsParams(uri, diagnostics(text)))

    @server.feature(types.TEXT_DOCUMENT_DID_OPEN)
    def opened(params: types.DidOpenTextDocumentParams) -> None:
        tell(params.text_document.uri)

    @server.feature(types.TEXT_DOCUMENT_DID_CHANGE)
    def changed(params: types.DidChangeTextDocumentParams) -> None:
        tell(params.text_document.uri)

    @server.feature(types.TEXT_DOCUMENT_COMPLETION, types.CompletionOptions(trigger_characters=["."]))
    async def complete(params: types.CompletionParams) -> list[types.CompletionItem]:
        wanted = subject(_text_before(server, params.text_document.uri, params.position))
        if wanted is None:
            return []
        names = await robot.names(wanted) if robot is not None else []
        if not wanted.path:
            names += [KnownName(word, _LANGUAGE, "") for word in words()]
        return [
            types.CompletionItem(each.name, kind=types.CompletionItemKind.Field, detail=each.meaning or None,
                                 sort_text=f"{number:05}")
            for number, each in enumerate(fitting(wanted, names))
        ]  # fmt: skip

    @server.feature(types.TEXT_DOCUMENT_HOVER)
    async def hover(params: types.HoverParams) -> types.Hover | None:
        document = server.workspace.get_text_document(params.text_document.uri)
        word = document.word_at_position(params.position)
        line = document.source.split("\n")[params.position.line]
        end = params.position.character
        while end < len(line) and (line[end].isalnum() or line[end] == "_"):
            end += 1
        wanted = subject(line[:end]) if word else None
        text = await robot.meaning(wanted) if robot is not None and wanted is not None and wanted.prefix else ""
        return types.Hover(types.MarkupContent(types.MarkupKind.PlainText, text)) if text else None

    return server


def diagnostics(text: str) -> list[types.Diagnostic]:
    """The errors and warnings of a text."""
    kinds = {True: types.DiagnosticSeverity.Warning, False: types.DiagnosticSeverity.Error}
    return [
        types.Diagnostic(types.Range(types.Position(*each.begin), types.Position(*each.end)), each.message,
                         severity=kinds[each.is_warning], source="urbiscript")
        for each in problems_of(text)
    ]  # fmt: skip


def _text_before(server: LanguageServer, uri: str, position: types.Position) -> str:
    """The text of a document before a position: a name may have its object in the line before."""
    document = server.workspace.get_text_document(uri)
    return document.source[: document.offset_at_position(position)]
