"""The language server: by the bytes of an editor, and what the parser tells."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import pytest
from lan_server import Lan, wait_for
from pygments.lexers import get_lexer_by_name  # type: ignore[import-untyped]

import urbihw
from urbihw.cli.main import main
from urbihw.neighbours.editor.problems import problems_of
from urbihw.neighbours.editor.textmate import grammar, words


def test_problems_are_where_editors_count() -> None:
    assert problems_of("1;\n2 + 3;\n") == []
    (problem,) = problems_of('var x = "\u00e9\U0001f600" 5;')
    assert (problem.begin, problem.end) == ((0, 14), (0, 15))
    assert problem.message == "unexpected float" and not problem.is_warning
    (problem,) = problems_of("f(1,\n")
    assert problem.begin[0] in (0, 1) and "end of command" in problem.message
    assert problems_of("}") and problems_of("\ud800") is not None
    assert problems_of("(" * 5000)


def test_the_grammar_for_colours_has_the_words_of_the_parser(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(("lsp", "--grammar")) == 0
    told = json.loads(capsys.readouterr().out)
    assert told == grammar() and told["scopeName"] == "source.urbiscript"
    patterns = {each["name"]: re.compile(each.get("match") or each["begin"]) for each in told["patterns"]}
    assert {"at", "whenever", "loop", "foreach"} < {*words()}
    assert all(patterns["keyword.control"].fullmatch(word) for word in ("at", "whenever", "stopif"))
    assert patterns["constant.numeric"].fullmatch("1.5e3ms") and not patterns["constant.numeric"].fullmatch("5x")


def test_pygments_knows_the_language() -> None:
    assert type(get_lexer_by_name("urbiscript")).__name__ == "UrbiscriptLexer"


class Editor:
    """An editor that speaks to the language server in messages with a length in front."""

    def __init__(self, *options: str) -> None:
        command = (sys.executable, "-m", "urbihw.cli.main", "lsp", *options)
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        assert self.process.stdin is not None and self.process.stdout is not None
        self._to: IO[bytes] = self.process.stdin
        self._from: IO[bytes] = self.process.stdout
        self._number = 0

    def tell(self, method: str, params: Any, **more: Any) -> None:
        body = json.dumps({"jsonrpc": "2.0", "method": method, "params": params, **more}).encode()
        self._to.write(b"Content-Length: %d\r\n\r\n%s" % (len(body), body))
        self._to.flush()

    def hear(self) -> Any:
        length = 0
        while (line := self._from.readline().strip()):
            if line.lower().startswith(b"content-length:"):
                length = int(line.split(b":")[1])
        return json.loads(self._from.read(length))

    def ask(self, method: str, params: Any) -> Any:
        self._number += 1
        self.tell(method, params, id=self._number)
        while True:
            message = self.hear()
            if message.get("id") == self._number:
                return message["result"]


@pytest.fixture
def lan(tmp_path: Path) -> Iterator[Lan]:
    made = Lan(tmp_path)
    try:
        with urbihw.connect("127.0.0.1", made.plain_port, timeout=20) as robot:
            robot.run("class Global.Arm { var val = 0; var limited = 1; function stop() { Global.stopped = 1 } };"
                      "var Global.stopped = 0; var Global.arm = Arm.new;")
        yield made
    finally:
        made.close()


@pytest.mark.e2e
def test_an_editor_gets_errors_names_and_help(lan: Lan) -> None:
    editor = Editor("-H", "127.0.0.1", "-P", str(lan.plain_port))
    uri = "file:///a.u"
    told = editor.ask("initialize", {"processId": None, "rootUri": None, "capabilities": {}})
    assert told["capabilities"]["hoverProvider"] and told["capabilities"]["completionProvider"]
    editor.tell("initialized", {})
    text = "arm.val = = 2;\narm.stop.x\nsleep\narm.lim"
    document = {"uri": uri, "languageId": "urbiscript", "version": 1, "text": text}
    editor.tell("textDocument/didOpen", {"textDocument": document})
    published = editor.hear()
    assert published["method"] == "textDocument/publishDiagnostics"
    (problem,) = [each for each in published["params"]["diagnostics"] if each["range"]["start"]["line"] == 0]
    assert problem["message"] == "unexpected =" and problem["range"]["start"]["character"] == 10

    def at(line: int, character: int) -> dict[str, Any]:
        return {"textDocument": {"uri": uri}, "position": {"line": line, "character": character}}

    def labels(line: int, character: int) -> list[str]:
        return [each["label"] for each in editor.ask("textDocument/completion", at(line, character))]

    # On a busy machine a robot may not answer in the time that an editor waits.
    wait_for(lambda: labels(3, 7) == ["limited"], "the names")
    assert labels(1, 10) == [], "a function on the way is not called"
    wait_for(lambda: "sleep" in str(editor.ask("textDocument/hover", at(2, 2))), "the help")
    assert editor.ask("textDocument/hover", at(0, 8)) is None
    changed = {"textDocument": {"uri": uri, "version": 2}, "contentChanges": [{"text": "1;"}]}
    editor.tell("textDocument/didChange", changed)
    assert editor.hear()["params"]["diagnostics"] == []
    assert editor.ask("shutdown", None) is None
    editor.tell("exit", None)
    with editor.process:
        assert editor.process.wait() == 0
    with urbihw.connect("127.0.0.1", lan.plain_port) as robot:
        assert robot.stopped == 0
