"""Questions to the user of a tool, on a terminal or through a pipe: one line of standard input is one answer."""

from __future__ import annotations

import sys
from typing import TextIO

from urbihw.buses.servos.registers import ServoError


class Dialogue:
    """Says and asks; without an answer (end of the input) a question is a refusal."""

    def __init__(self, read: TextIO | None = None, write: TextIO | None = None) -> None:
        self._read = sys.stdin if read is None else read
        self._write = sys.stdout if write is None else write

    def say(self, text: str) -> None:
        """Print a line at once."""
        print(text, file=self._write, flush=True)

    def confirm(self, question: str) -> bool:
        """Ask a question; only y or yes is a yes."""
        return self._ask(f"{question} [y/N] ").strip().lower() in {"y", "yes"}

    def wait(self, text: str) -> None:
        """Ask for something to be done; return at Enter. Raises ServoError at q, and at the end of the input."""
        answer = self._ask(f"{text}, then press Enter (q ends): ")
        if not answer or answer.strip().lower() == "q":
            raise ServoError("ended before it was done; nothing further is changed")

    def _ask(self, question: str) -> str:
        self._write.write(question)
        self._write.flush()
        answer = self._read.readline()
        if not self._read.isatty():
            # The answer of a pipe is not on the screen, where it would end the line.
            self._write.write("\n")
        return answer
