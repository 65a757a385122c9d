"""Regular expressions that may take long: a worker process searches for them and is killed after a time limit.

A search by Python's ``re`` cannot be cancelled and blocks all other threads, and its time and memory may double with
each character of the text.
"""

from __future__ import annotations

import contextlib
import marshal
import subprocess
import sys
from pathlib import Path
from typing import Final

CHILD: Final = Path(__file__).with_name("match_child.py")
FAILED: Final = "could not be looked for"


class Matcher:
    """The worker process, started on demand.  Calls may come from any thread, one at a time."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None

    def search(self, expression: str, text: str, seconds: float) -> list[str] | None:
        """The first match and its groups, or None.  Raises TimeoutError, and ValueError for other failures."""
        process = self._process if self._process is not None else self._begin()
        assert process.stdin is not None and process.stdout is not None
        data = marshal.dumps((expression, text, seconds))
        answer: list[str] | str | None = FAILED
        try:
            process.stdin.write(len(data).to_bytes(4, "big") + data)
            process.stdin.flush()
            head = process.stdout.read(4)
            if len(head) < 4:
                raise TimeoutError
            answer = marshal.loads(process.stdout.read(int.from_bytes(head, "big")))
        except (BrokenPipeError, EOFError, ValueError):
            self.close()
        except BaseException:
            self.close()
            raise
        if isinstance(answer, str):
            raise ValueError(answer)
        return answer

    def _begin(self) -> subprocess.Popen[bytes]:
        made = subprocess.Popen([sys.executable, "-I", "-S", str(CHILD)], stdin=subprocess.PIPE,
                                stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        self._process = made
        return made

    def close(self) -> None:
        """End the process; the next search starts another one."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            with contextlib.suppress(OSError):
                process.communicate()
