"""The folder of the motions and poses of a robot: ``NAME.jsonl`` and ``NAME.mtn``, poses in the folder ``poses``.

Names are letters, digits, ``_`` and ``-``, so no name leads out of the folder.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

from urbihw.files import BadFile, cannot_read, read_regular, write_regular
from urbihw.platforms.teach import mtn
from urbihw.platforms.teach.mtn import MotionFile
from urbihw.platforms.teach.recording import MAX_BYTES, BadMotion, MotionRecording, parse
from urbihw.settings import guess

SUFFIX: Final = ".jsonl"
MTN: Final = ".mtn"
_NAME: Final = re.compile(r"[A-Za-z0-9_-]{1,64}", re.ASCII)


def check_name(name: str, what: str) -> None:
    """Raise BadMotion for a name that no motion or pose can have; ``what`` is the word for one of them."""
    if not _NAME.fullmatch(name):
        raise BadMotion(f"{name!r}: the name of a {what} has 1 to 64 letters, digits, _ or -")


class Store:
    """A folder of motions, or of poses; ``what`` is the word for one of them."""

    def __init__(self, folder: Path | None, what: str) -> None:
        """``folder`` is made when something is written; None for no folder."""
        self._folder = folder
        self._what = what

    def names(self) -> list[str]:
        """The names of what there is, in order; those of RoboPlus with their suffix.  Raises ValueError if the folder
        cannot be read.
        """
        if self._folder is None or not self._folder.is_dir():
            return []
        try:
            files = [file for file in self._folder.iterdir() if _NAME.fullmatch(file.stem) and file.is_file()]
        except OSError as error:
            raise BadFile(cannot_read(self._folder, error)) from error
        return sorted(
            [file.stem for file in files if file.suffix == SUFFIX] + [file.name for file in files if file.suffix == MTN]
        )

    def load(self, name: str) -> MotionRecording:
        """Return a motion or pose.  Raises ValueError: there is none, or the file is no motion."""
        file = self._file(name, SUFFIX)
        try:
            return parse(self._read(file, name).decode("utf-8"), file.name)
        except UnicodeDecodeError as error:
            raise BadMotion(f"{file.name}: this is not UTF-8") from error

    def load_pages(self, name: str) -> MotionFile:
        """Return the pages of a file of RoboPlus, by its name with ``.mtn``.  Raises ValueError."""
        return mtn.parse(self._read(self._file(name.removesuffix(MTN), MTN), name), name)

    def save(self, name: str, recording: MotionRecording) -> None:
        """Write a motion or pose at once.  Raises ValueError if it cannot be written."""
        file = self._file(name, SUFFIX)
        try:
            file.parent.mkdir(mode=0o755, parents=True, exist_ok=True)
        except OSError as error:
            raise BadFile(f"{file.parent}: cannot be made: {error.strerror}") from error
        write_regular(file, recording.text().encode("utf-8"))

    def check_name(self, name: str) -> None:
        """Raise ValueError for a name that no file of this folder can have."""
        self._file(name, SUFFIX)

    def _file(self, name: str, suffix: str) -> Path:
        check_name(name, self._what)
        if self._folder is None:
            raise BadMotion(f"there is no folder for a {self._what}: name one in the setting motions")
        return self._folder / f"{name}{suffix}"

    def _read(self, file: Path, name: str) -> bytes:
        try:
            return read_regular(file, MAX_BYTES).data
        except FileNotFoundError:
            raise BadMotion(f"there is no {self._what} {name!r}{guess(name, self.names())}") from None
