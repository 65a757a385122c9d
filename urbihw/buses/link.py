"""Ports and byte links: what every way of reaching a robot has in common.

A port is named by a url (`Url`), opened, closed and counted. Most are links: a `Link` moves bytes and knows no
protocol. Add one by subclassing `Link` and adding a row to `urbihw.buses.BUSES`; the contract tests then run over it by
themselves. A port that carries something other than bytes (CAN frames) is another subclass of `Port`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping
from dataclasses import field
from typing import TYPE_CHECKING, Self
from urllib.parse import parse_qsl

from urbihw.buses.clock import BusClock, BusRealClock
from urbihw.buses.errors import BadUrl, LinkGone
from urbihw.frozen import frozen
from urbihw.settings import SettingRule, from_texts

if TYPE_CHECKING:
    from urbihw.buses.pipe import PipeEnd

DEFAULT_BAUD = 1_000_000  # factory speed of the AX series, the commonest bus here
BAUD = SettingRule((int,), "a number such as 57600 or 1000000", least=1)
_BITS_PER_BYTE = 10  # start, 8 data, stop
_FIND_THEIR_TARGET = {"spykee", "webots"}  # schemes of ports that look for their robot themselves
_MOST_DISCARDED = 1 << 16  # far more than any system holds for a reader that sleeps


@frozen(slots=False)
class Url:
    """A bus url taken apart: `scheme://target?key=value`.

    A text without `://` is the path of a serial device, so `/dev/ttyUSB0?baud=57600` works as it is.

    Attributes:
        text: the url as the user wrote it, for messages.
        scheme: row of `BUSES`.
        target: what stands between `://` and `?`.
        options: what stands behind `?`; the port says what there may be, and in which type.
    """

    text: str
    scheme: str
    target: str
    options: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def parse(cls, text: str) -> Url:
        """Take `text` apart. Raises BadUrl for unprintable text, without a target, or an option not `key=value`."""
        if not text.isprintable():
            raise BadUrl(f"bus url {text!r} contains unprintable characters, such as the end of a line")
        scheme, separator, rest = text.partition("://")
        if not separator:
            scheme, rest = "serial", text
        if scheme == "spy":
            # The options behind the inner url belong to the inner link.
            target, query = rest, ""
            if rest.startswith("spy://"):
                raise BadUrl("bus url: one spy:// is enough")
        else:
            target, _, query = rest.partition("?")
        if not target and scheme not in _FIND_THEIR_TARGET:
            raise BadUrl(f"bus url {text!r} names no port: write for instance /dev/ttyUSB0 or socket://host:port")
        return cls(text, scheme, target, _pairs(text, query))


def serial_path(url: str) -> str:
    """Return the path of the serial device that a url names, also behind `spy://`; "" if it names none.

    Raises BadUrl.
    """
    parsed = Url.parse(url)
    if parsed.scheme == "spy":
        return serial_path(parsed.target)
    return parsed.target if parsed.scheme == "serial" else ""


def split_parameters(url: str, names: Collection[str]) -> tuple[str, dict[str, str]]:
    """Split the parameters `names` off a url: those are meant for the robot, the rest for its port.

    Raises BadUrl when what stands behind `?` is not `key=value`.
    """
    head, _, query = url.partition("?")
    pairs = query.split("&") if query else []
    kept = [pair for pair in pairs if pair.partition("=")[0] not in names]
    taken = "&".join(pair for pair in pairs if pair not in kept)
    return head + ("?" + "&".join(kept) if kept else ""), _pairs(url, taken)


def _pairs(url: str, query: str) -> dict[str, str]:
    try:
        return dict(parse_qsl(query, strict_parsing=True)) if query else {}
    except ValueError as error:
        raise BadUrl(f"bus url {url!r}: options behind '?' must be written key=value&key=value") from error


@frozen(slots=False)
class Context:
    """What a link may need from the code that opens it.

    Attributes:
        clock: the time that deadlines are measured on.
        pipes: the far ends that `pipe://name` urls can reach, by name; only tests have any.
        parent_work: tells the seconds of processor time that the parent of the worker has had, None where that is
            unknown: who waits for the parent on a loaded machine counts these.
    """

    clock: BusClock = field(default_factory=BusRealClock)
    pipes: Mapping[str, PipeEnd] = field(default_factory=dict)
    parent_work: Callable[[], float | None] = lambda: None


class Port(ABC):
    """Something to open by its url. The base does states, counting and `with`.

    A subclass MUST implement `_open`, which raises Unavailable, and `_close`, and count what it moves. What is wrong
    with its url it says when it is made: `parameters` are those it takes behind `?` (BadUrl for any other, or a wrong
    value), and `options` what it was given, in the types of the rules. It MAY set `baud` (bits per second on the wire)
    when the url does not decide it. `close` twice is fine and it never raises. `warning` is a line for the user about
    the way it was opened, "" for none.
    """

    warning = ""

    def __init__(self, url: Url, context: Context) -> None:
        self.options, mistakes = from_texts(self.parameters(url), url.options, "parameter")
        if mistakes:
            raise BadUrl(f"bus url {url.text!r}: {mistakes[0]}")
        self.url = url
        self.clock = context.clock
        self._context = context
        self.baud: int = self.options.get("baud", DEFAULT_BAUD)
        self.bytes_read = 0
        self.bytes_written = 0
        self.observer: Callable[[str, bytes], None] | None = None
        """Called with ">" or "<" and what was written or read; None, the usual case, without an observer."""
        self.before_wait: Callable[[float], None] | None = None
        """Called with the deadline before each wait for input: the worker gives its sign of life."""
        self.beside: tuple[int, ...] = ()
        """Descriptors of the worker: a port with a descriptor of its own looks at them during each wait for input, too,
        so that the worker need not ask the system once more between two questions."""
        self.is_quiet = False
        """Whether the last wait has found nothing to read beside; a port that does not look leaves it false."""
        self._is_open = False

    @classmethod
    def parameters(cls, url: Url) -> Mapping[str, SettingRule]:
        """Return the rules of the parameters behind `?` of a url of this kind."""
        return {"baud": BAUD}

    @property
    def is_open(self) -> bool:
        """True between `open` and `close`."""
        return self._is_open

    @property
    def context(self) -> Context:
        """What it was opened with: for another port of the same robot."""
        return self._context

    @property
    def byte_time(self) -> float:
        """Seconds one byte takes on the wire."""
        return _BITS_PER_BYTE / self.baud

    def twin(self) -> Self:
        """Return another port to the same place, closed: for what takes several connections."""
        return type(self)(self.url, self._context)

    def open(self) -> None:
        """Open it; nothing happens if it is open. Raises Unavailable."""
        if not self._is_open:
            self._open()
            self._is_open = True

    def close(self) -> None:
        """Close it; calling it twice is fine and it never raises."""
        if self._is_open:
            self._is_open = False
            self._close()

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @abstractmethod
    def _open(self) -> None: ...

    @abstractmethod
    def _close(self) -> None: ...


class Link(Port):
    """A port for bytes. The base does the counting; subclasses move the bytes.

    A subclass MUST
      - implement `_open`, `_close`, `_read`, `_write`;
      - raise Unavailable from `_open`, LinkGone from `_read` and `_write` when the other side is gone;
      - return from `_read` as soon as at least one byte is there, and b"" at the deadline;
      - send all of `data` in `_write`, in one piece where the system allows it (a servo gives up on a pause).
    A subclass MAY
      - override `discard` when its system can throw input away faster than by reading it;
      - set `packets` when what is written in one piece arrives in one piece, and a read gives at most one such piece;
      - override `is_writable` when bytes may wait in the system for long.
    It MUST NOT sleep otherwise, start threads, or know what the bytes mean.
    """

    packets = False

    def read(self, size: int, deadline: float) -> bytes:
        """Return 1 to `size` bytes as soon as some are there, or b"" when `deadline` passes.

        A deadline in the past still collects what has already arrived. Raises LinkGone.
        """
        if not self._is_open:
            raise LinkGone(f"{self.url.text} is closed")
        if self.before_wait is not None:
            self.before_wait(deadline)
        data = self._read(size, deadline)
        self.bytes_read += len(data)
        if self.observer is not None and data:
            self.observer("<", data)
        return data

    def write(self, data: bytes) -> None:
        """Hand `data` to the wire; it may still be on its way when this returns. Raises LinkGone."""
        if not self._is_open:
            raise LinkGone(f"{self.url.text} is closed")
        self._write(data)
        self.bytes_written += len(data)
        if self.observer is not None:
            self.observer(">", data)

    def is_writable(self) -> bool:
        """Whether what is written now would leave soon: asked before bulk data, behind which a stop would wait."""
        return True

    def set_dtr(self, on: bool) -> None:
        """Set the modem line DTR, where there is one."""

    def discard(self) -> int:
        """Discard all input that has arrived, with an upper bound for a peer that never stops sending.

        Returns how many bytes that were. Raises LinkGone.
        """
        count = 0
        while count < _MOST_DISCARDED and (data := self.read(4096, self.clock.now())):
            count += len(data)
        return count

    @abstractmethod
    def _read(self, size: int, deadline: float) -> bytes: ...

    @abstractmethod
    def _write(self, data: bytes) -> None: ...


def byte_link(port: Port) -> Link:
    """The port, if it moves bytes. Raises BadUrl when it does not."""
    if not isinstance(port, Link):
        raise BadUrl(f"{port.url.text} moves no bytes: this robot needs a url such as /dev/ttyUSB0 or socket://host:port")
    return port


def set_line_speed(link: Link, baud: int) -> None:
    """Change the speed of a serial line, in bits per second; no effect on other links. Raises Unavailable."""
    if has_line_speed(link) and link.baud != baud:
        link.close()
        link.baud = baud
        link.open()


def set_dtr(link: Link, *, on: bool) -> None:
    """Set the modem line DTR of a serial port, with which some adapters switch a motor; no effect on other links."""
    if has_line_speed(link):
        link.set_dtr(on)


def has_line_speed(link: Link) -> bool:
    """Return whether the host sets the line speed: true for a serial line, false over TCP and in tests."""
    return link.url.scheme == "serial"
