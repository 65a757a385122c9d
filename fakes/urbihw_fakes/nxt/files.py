"""The flash of the brick: files and the handles to them (firmware: c_loader.c)."""

from __future__ import annotations

from dataclasses import dataclass
from fnmatch import fnmatchcase

from urbihw_fakes.nxt import codes

HANDLES = 16
LINEAR = (".rxe", ".sys", ".rtm")
FREE = 65536


@dataclass
class Handle:
    """An open file: `room` bytes may still be written; `names` are the remaining results of a search."""

    name: str
    position: int = 0
    room: int = 0
    names: tuple[str, ...] | None = None


class Files:
    """Files by name, and open handles by number."""

    def __init__(self) -> None:
        self.contents: dict[str, bytearray] = {"Demo.rxe": bytearray(b"MindstormsNXT\0\0\5".ljust(64, b"\0"))}
        self.free = FREE
        self._handles: dict[int, Handle] = {}

    def find(self, name: str) -> str | None:
        """Return the name as it is stored; names are case-insensitive."""
        return next((known for known in self.contents if known.lower() == name.lower()), None)

    def open_read(self, name: str) -> tuple[int, int, int]:
        """Return status, handle, size."""
        known = self.find(name)
        if known is None:
            return codes.FILE_NOT_FOUND, 0, 0
        status, number = self._add_handle(Handle(known))
        return status, number, len(self.contents[known]) if status == codes.OK else 0

    def open_write(self, name: str, size: int, data: bool = False) -> tuple[int, int]:
        """Return status, handle; `data` refuses names that are stored linearly."""
        if data and name.lower().endswith(LINEAR) or not 0 < len(name) <= 19:
            return codes.ILLEGAL_NAME, 0
        if self.find(name) is not None:
            return codes.FILE_EXISTS, 0
        if size > self.free:
            return codes.NO_SPACE, 0
        status, number = self._add_handle(Handle(name, room=size))
        if status == codes.OK:
            self.contents[name] = bytearray()
            self.free -= size
        return status, number

    def open_append(self, name: str) -> tuple[int, int, int]:
        """Return status, handle, room; a closed file has no room left here."""
        known = self.find(name)
        if known is None:
            return codes.FILE_NOT_FOUND, 0, 0
        return codes.FILE_FULL, 0, 0

    def read(self, number: int, count: int) -> tuple[int, bytes]:
        """Return the status and exactly `count` bytes, zeros beyond the end."""
        handle = self._handles.get(number)
        if handle is None or handle.names is not None:
            return codes.ILLEGAL_HANDLE, bytes(count)
        data = bytes(self.contents[handle.name][handle.position : handle.position + count])
        handle.position += len(data)
        return (codes.OK if len(data) == count else codes.END_OF_FILE), data.ljust(count, b"\0")

    def write(self, number: int, data: bytes) -> tuple[int, int]:
        """Return the status and the number of bytes written."""
        handle = self._handles.get(number)
        if handle is None or handle.names is not None:
            return codes.ILLEGAL_HANDLE, 0
        taken = data[: handle.room]
        self.contents[handle.name] += taken
        handle.room -= len(taken)
        return (codes.OK if len(taken) == len(data) else codes.FILE_FULL), len(taken)

    def close(self, number: int) -> int:
        """Close a handle; return the status."""
        return codes.OK if self._handles.pop(number, None) is not None else codes.HANDLE_CLOSED

    def close_all(self) -> None:
        """Close all handles: the cable was unplugged."""
        self._handles.clear()

    def delete(self, name: str) -> int:
        """Delete a file; return the status."""
        known = self.find(name)
        if known is None:
            return codes.FILE_NOT_FOUND
        self.free += len(self.contents.pop(known))
        return codes.OK

    def clear(self) -> None:
        """Remove all files: DELETE USER FLASH."""
        self.contents.clear()
        self.free = FREE

    def find_first(self, pattern: str) -> tuple[int, int, str, int]:
        """Return status, handle, name, size of the first file that matches `*.*`, `name.*`, `*.ext` or a name."""
        found = tuple(sorted(name for name in self.contents if fnmatchcase(name.lower(), pattern.lower())))
        if not found:
            return codes.FILE_NOT_FOUND, 0, "", 0
        status, number = self._add_handle(Handle("", names=found))
        return self.find_next(number) if status == codes.OK else (status, 0, "", 0)

    def find_next(self, number: int) -> tuple[int, int, str, int]:
        """Return the same for the next file."""
        handle = self._handles.get(number)
        if handle is None or handle.names is None:
            return codes.ILLEGAL_HANDLE, number, "", 0
        if not handle.names:
            return codes.FILE_NOT_FOUND, number, "", 0
        name, *rest = handle.names
        handle.names = tuple(rest)
        return codes.OK, number, name, len(self.contents.get(name, b""))

    def _add_handle(self, handle: Handle) -> tuple[int, int]:
        number = next((number for number in range(HANDLES) if number not in self._handles), None)
        if number is None:
            return codes.NO_MORE_HANDLES, 0
        self._handles[number] = handle
        return codes.OK, number
