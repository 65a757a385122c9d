"""The devices that the last run of the daemon found, in a file: the slots of a robot that is absent at the start.

The file is JSON: the url, and each device as the driver described it in ``Found``.  It is never trusted: a file of
another url, of a wrong form, or larger than ``MAX_BYTES`` is ignored.  Nothing in it moves anything; what the robot
tells when it comes replaces it.
"""

from __future__ import annotations

import dataclasses
import json
import types
import typing
from collections.abc import Callable, Hashable, Iterable, Mapping
from pathlib import Path
from typing import Any, Final

from urbihw.files import BadFile, read_regular, write_regular

MAX_BYTES: Final = 256 * 1024
MAX_MEMBERS: Final = 1000
"""Maximum length of a list or table in the file, and of a text."""
_MAX_WHOLE: Final = 1 << 63


class BadMemory(ValueError):
    """The file cannot be used; the message is the reason."""


class DeviceMemory:
    """The devices of one robot, kept from run to run.

    Attributes:
        found: the devices that the worker has found in this run, by their ids; "" for a robot of one part.
        file: where they are kept; None if they are not.
    """

    def __init__(self, kind: type | None, warn: Callable[..., None]) -> None:
        """``kind`` is the dataclass of a device, None where nothing of it is of use for the next run; ``warn`` logs."""
        self._kind = kind
        self._warn = warn
        self._url = ""
        self.found: dict[Hashable, Any] = {}
        self.file: Path | None = None

    def use(self, file: str, url: str) -> None:
        """Keep the devices of the robot at a url in a file; "" for none."""
        self._url = url
        self.file = Path(file) if file and self._kind is not None else None

    def recall(self) -> tuple[Any, ...]:
        """Return the devices that the last run found; () if that is not known."""
        if self.file is None or self._kind is None:
            return ()
        try:
            return load(self.file, self._url, self._kind)
        except (BadMemory, OSError) as error:
            self._warn("the devices of the last run are not known: %s: %s", self.file, error)
            return ()

    def keep(self, devices: Iterable[Any]) -> None:
        """Keep the devices that were found for the next run, if they are others than before."""
        before = dict(self.found)
        self.found |= {getattr(each, "id", ""): each for each in devices}
        if self.found != before:
            self._save()

    def drop(self, devices: Iterable[Hashable]) -> None:
        """Forget devices by their ids: they are not of this robot."""
        for device in devices:
            self.found.pop(device, None)
        self._save()

    def _save(self) -> None:
        if self.file is None:
            return
        try:
            save(self.file, self._url, self.found.values())
        except (BadFile, OSError) as error:
            self._warn("the devices are not kept for the next run: %s", error)
            self.file = None


def load(path: Path, url: str, kind: type) -> tuple[Any, ...]:
    """Return the devices, dataclasses of a ``kind``; () if there is no file, or it is of another url.

    Raises BadMemory, OSError.
    """
    try:
        data = read_regular(path, MAX_BYTES).data
    except FileNotFoundError:
        return ()
    except BadFile as error:
        raise BadMemory(str(error)) from error
    try:
        content = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise BadMemory("it is not JSON") from error
    if not isinstance(content, dict) or content.keys() != {"url", "devices"}:
        raise BadMemory("it has other keys than url and devices")
    if content["url"] != url:
        return ()
    devices: tuple[Any, ...] = _made(tuple[kind, ...], content["devices"])  # type: ignore[valid-type]
    return devices


def save(path: Path, url: str, devices: Iterable[Any]) -> None:
    """Replace the file as a whole.  Raises BadFile, OSError."""
    text = json.dumps({"url": url, "devices": [dataclasses.asdict(each) for each in devices]}, indent=1)
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    write_regular(path, text.encode())


def _made(kind: Any, value: Any) -> Any:
    """Return a value of JSON as a value of the type ``kind``.  Raises BadMemory."""
    origin, parts = typing.get_origin(kind), typing.get_args(kind)
    if origin is tuple:
        return tuple(_made(parts[0], each) for each in _bounded(value, list))
    if origin is not None and isinstance(origin, type) and issubclass(origin, Mapping):
        return {_made(parts[0], key): _made(parts[1], each) for key, each in _bounded(value, dict).items()}
    if origin in (types.UnionType, typing.Union):
        return _made(next((part for part in parts if type(value) is part), parts[0]), value)
    if dataclasses.is_dataclass(kind):
        return _made_row(kind, value)
    if kind is float and type(value) in (int, float):
        return float(value)
    if type(value) is not kind or (kind is int and abs(value) >= _MAX_WHOLE):
        raise BadMemory(f"a {type(value).__name__} stands where a {getattr(kind, '__name__', kind)} belongs")
    return _bounded(value, str) if kind is str else value


def _made_row(kind: Any, value: Any) -> Any:
    hints = typing.get_type_hints(kind)
    names = [each.name for each in dataclasses.fields(kind)]
    if not isinstance(value, dict) or value.keys() != set(names):
        raise BadMemory(f"a device has other keys than {', '.join(names)}")
    return kind(**{name: _made(hints[name], value[name]) for name in names})


def _bounded(value: Any, kind: type) -> Any:
    if not isinstance(value, kind) or len(value) > MAX_MEMBERS:  # type: ignore[arg-type]
        raise BadMemory(f"a {kind.__name__} of at most {MAX_MEMBERS} members belongs there")
    return value
