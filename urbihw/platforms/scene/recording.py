"""Recorded states of a world: a line of JSON, the model if it is one that MuJoCo has written, and the states."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Final

from urbihw.platforms.scene.state import time_of

MAX_BYTES: Final = 64 * 1024 * 1024
"""Largest size of the states of a recording; later states are left out."""
COMPILED: Final = ".mjb"
"""Ending of a model that MuJoCo has written: it is one file, and may be gone with the simulated robot."""
_KIND: Final = "urbihw world 1"


class BadRecording(Exception):
    """The file is not a recording; the message is one line."""


class SceneRecording:
    """States of one model, ``rate`` of them in a second of the simulation.

    Attributes:
        model: its file.
        compiled: the content of that file, b"" if it is not ``COMPILED``.
    """

    def __init__(self, model: Path, rate: float, compiled: bytes = b"") -> None:
        self.model = model
        self.rate = rate
        self.compiled = compiled
        self.states: list[bytes] = []
        self._size = 0

    @classmethod
    def begin(cls, model: Path, rate: float) -> SceneRecording:
        """An empty recording.  Raises ValueError if the model cannot be read."""
        try:
            return cls(model, rate, model.read_bytes() if model.suffix == COMPILED else b"")
        except OSError as error:
            raise ValueError(f"the model {model} cannot be read: {error.strerror}") from error

    def add(self, state: bytes) -> None:
        """Keep one more state of the model."""
        self._size += len(state)
        if self._size <= MAX_BYTES:
            self.states.append(state)

    @property
    def period(self) -> float:
        """Seconds of the simulation between two states: those of ``rate``, rounded up to its steps."""
        if len(self.states) < 2:
            return 1 / self.rate
        return max(0.001, (time_of(self.states[-1]) - time_of(self.states[0])) / (len(self.states) - 1))

    def data(self) -> bytes:
        """Return what ``parse`` reads."""
        size = len(self.states[0]) if self.states else 0
        head = {
            "kind": _KIND, "model": str(self.model), "rate": self.rate, "size": size, "compiled": len(self.compiled),
        }  # fmt: skip
        states = b"".join(each for each in self.states if len(each) == size)
        return json.dumps(head).encode() + b"\n" + self.compiled + states

    @classmethod
    def parse(cls, data: bytes) -> SceneRecording:
        """Return the recording that a file contains.  Raises BadRecording."""
        line, _, rest = data.partition(b"\n")
        try:
            head = json.loads(line)
            size, compiled = int(head["size"]), int(head["compiled"])
            found = cls(Path(head["model"]), float(head["rate"]), rest[:compiled])
            right = head["kind"] == _KIND and found.rate > 0 and size >= 0 and compiled >= 0
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            raise BadRecording("this is no recording of a world") from error
        if not right:
            raise BadRecording("this is no recording of a world")
        if size:
            found.states = [rest[at : at + size] for at in range(compiled, len(rest) - size + 1, size)]
        return found
