"""A CAN bus by url, through python-can: `can://INTERFACE/CHANNEL?option=value`.

INTERFACE is python-can's name; the options are passed to it. Valid options are the parameters that python-can's class
of the interface has or documents. `bitrate` is 500000 if not given (a socketcan interface keeps the one it was set up
with). Settings files of python-can are not read: the url holds all settings.

`receive` returns only classic data frames with 11-bit identifiers. On a multicast bus any program may send, and a
serial adapter may send anything: data that is not a frame is counted in `damaged` and dropped.
"""

from __future__ import annotations

import errno
import fcntl
import importlib
import inspect
import logging
import os
import re
import select
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import can
from can.interfaces import BACKENDS

from urbihw.buses.can.frame import CanFrame
from urbihw.buses.can.pipe import PipeBus
from urbihw.buses.can.slcan import SlcanText
from urbihw.buses.errors import BadUrl, BusTimeout, LinkGone, Unavailable
from urbihw.buses.link import Context, Port, Url
from urbihw.buses.serial import no_port
from urbihw.settings import ANY, SettingRule, guess

DEFAULT_BITRATE: Final = 500_000
_PATHS: Final = {"slcan"}
"""Interfaces whose channel is the path of a serial port."""
_CHUNK: Final = 65536
_FULL: Final = {errno.ENOBUFS, errno.EAGAIN}
BITRATE: Final = SettingRule((int,), "a number such as 500000", least=1)
_RESERVED: Final = {"self", "channel", "can_filters", "timing", "kwargs"}
"""Parameters of python-can that cannot be given in a url."""
_DOCUMENTED: Final = re.compile(r":param (?:[^:]* )?(\w+):")


class CanPort(Port):
    """One bus.

    Attributes:
        damaged: number of received items that were not frames, since opening.
    """

    def __init__(self, url: Url, context: Context) -> None:
        self.interface, _, channel = url.target.partition("/")
        if not channel:
            raise BadUrl(f"bus url {url.text!r}: write can://INTERFACE/CHANNEL, such as can://socketcan/can0")
        super().__init__(url, context)
        self.channel = f"/{channel}" if self._uses_serial_port(channel) else channel
        self.baud = self.options.setdefault("bitrate", DEFAULT_BITRATE)
        self.damaged = 0
        self._context = context
        self._bus: can.BusABC | PipeBus | None = None
        self._lock = -1
        self._text: SlcanText | None = None
        self._waiting: list[CanFrame] = []

    @classmethod
    def parameters(cls, url: Url) -> Mapping[str, SettingRule]:
        """Return the rules of the parameters of python-can's interface."""
        interface = url.target.partition("/")[0]
        if interface == "pipe":
            names: set[str] = set()
        elif interface in BACKENDS:
            names = _parameters(*BACKENDS[interface])
            # The parameters of an interface that is not installed are unknown; opening the port reports it as missing.
            names = names or set(url.options)
        else:
            known = (*BACKENDS, "pipe")
            raise BadUrl(f"bus url {url.text!r}: {interface}: no such interface of python-can{guess(interface, known)}")
        return dict.fromkeys(sorted(names), ANY) | {"bitrate": BITRATE}

    @property
    def byte_time(self) -> float:
        """Seconds that 8 bits take on the bus."""
        return 8 / self.baud

    @property
    def _open_bus(self) -> can.BusABC | PipeBus:
        if self._bus is None:
            raise LinkGone(f"{self.url.text} is closed")
        return self._bus

    def send(self, frame: CanFrame) -> None:
        """Send a frame. Raises BusTimeout when the adapter's buffer is full (no ACK on the bus?), LinkGone."""
        message = can.Message(arbitration_id=frame.id, data=frame.data, is_extended_id=False)
        try:
            self._open_bus.send(message)
        except LinkGone:
            raise
        except can.CanTimeoutError as error:
            raise BusTimeout(self._full_text()) from error
        except (can.CanError, OSError) as error:
            if _number_of(error) in _FULL:
                raise BusTimeout(self._full_text()) from error
            raise self._link_gone(error) from error
        self.bytes_written += frame.wire_bytes
        self._show(">", (frame,))

    def receive(self, limit: int, deadline: float) -> list[CanFrame]:
        """Wait for a frame until `deadline`, then return all that have arrived, at most `limit`.

        A deadline in the past still collects what has arrived. Raises LinkGone.
        """
        if self.before_wait is not None:
            self.before_wait(deadline)
        pause = max(0.0, deadline - self.clock.now())
        frames = self._receive_text(limit, pause) if self._text is not None else self._receive(limit, pause)
        self._show("<", frames)
        return frames

    def _show(self, direction: str, frames: Sequence[CanFrame]) -> None:
        if self.observer is not None:
            for frame in frames:
                self.observer(direction, frame.id.to_bytes(2, "big") + frame.data)

    def _receive(self, limit: int, pause: float) -> list[CanFrame]:
        frames: list[CanFrame] = []
        for _ in range(limit):
            message, damaged = self._next_message(pause)
            if damaged:
                self.damaged += 1
                continue
            if message is None:
                break
            pause = 0.0
            if _is_classic_data(message):
                frame = CanFrame(message.arbitration_id, bytes(message.data))
                self.bytes_read += frame.wire_bytes
                frames.append(frame)
        return frames

    def _receive_text(self, limit: int, pause: float) -> list[CanFrame]:
        bus = self._open_bus
        assert self._text is not None and isinstance(bus, can.BusABC)
        fd = bus.fileno()
        frames, self._waiting = self._waiting, []
        try:
            while len(frames) < limit and select.select((fd,), (), (), 0 if frames else pause)[0]:
                data = os.read(fd, _CHUNK)
                if not data:
                    raise LinkGone(f"{self.url.text}: the other side closed; was it unplugged?")
                frames += self._text.feed(data)
                pause = 0.0
        except BlockingIOError:
            # `select` was a false alarm; there is no data now.
            pass
        except OSError as error:
            if isinstance(error, LinkGone):
                raise
            raise self._link_gone(error) from error
        self.damaged += self._text.pop_damaged_count()
        frames, self._waiting = frames[:limit], frames[limit:]
        self.bytes_read += sum(frame.wire_bytes for frame in frames)
        return frames

    def _next_message(self, pause: float) -> tuple[can.Message | None, bool]:
        """Return the next message, and whether damaged data came instead of one."""
        try:
            return self._open_bus.recv(pause), False
        except LinkGone:
            raise
        except (ValueError, IndexError):
            # Malformed text of a serial adapter: python-can passes the conversion error on.
            return None, True
        except (can.CanError, OSError) as error:
            if "unpack" in str(error):
                # A datagram that is not a frame; any program may send one.
                return None, True
            raise self._link_gone(error) from error

    def _open(self) -> None:
        silence_logger("can")
        try:
            self._lock_serial_port()
            self._bus = self._make_bus()
            self._text = SlcanText() if self.interface == "slcan" else None
        except (NotImplementedError, ImportError) as error:
            self._close()
            known = _known_interfaces()
            raise Unavailable(errno.ENOENT, f"{self.url.text}: {error}; python-can knows: {known}") from error
        except Unavailable:
            raise
        except (can.CanError, OSError) as error:
            self._close()
            raise self._unavailable(error) from error
        except (ValueError, TypeError) as error:
            self._close()
            raise BadUrl(f"bus url {self.url.text!r}: {error}") from error

    def _make_bus(self) -> can.BusABC | PipeBus:
        if self.interface == "pipe":
            return PipeBus(self.channel, self._context)
        return can.Bus(self.channel, self.interface, ignore_config=True, **self.options)

    def _close(self) -> None:
        bus, self._bus = self._bus, None
        if bus is not None:
            try:
                bus.shutdown()
            except (can.CanError, OSError):
                # The shutdown of an unplugged adapter fails, and python-can then leaves its serial port open.
                port = getattr(bus, "serialPortOrig", None)
                if port is not None:
                    port.close()
        if self._lock >= 0:
            os.close(self._lock)
            self._lock = -1

    def _lock_serial_port(self) -> None:
        """Lock the port of a serial adapter as pyserial does; python-can does not."""
        if self._uses_serial_port(self.channel):
            self._lock = os.open(self.channel.partition("@")[0], os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)

    def _uses_serial_port(self, channel: str) -> bool:
        return self.interface in _PATHS and "://" not in channel

    def _unavailable(self, error: Exception) -> Unavailable:
        number, name = _number_of(error), self.channel
        none = no_port(name.partition("@")[0]) if self._uses_serial_port(name) else None
        if none is not None:
            return none
        if number in {errno.EWOULDBLOCK, errno.EBUSY}:
            text = f"{name} is in use by another program; close that one first"
        elif number in {errno.EACCES, errno.EPERM}:
            text = f"no permission to open {name}: sudo usermod -aG dialout $USER, then log in again"
        elif number == errno.ENODEV:
            text = f"no CAN interface {name}: plug it in, then sudo ip link set {name} up type can bitrate {self.baud}"
        elif number == errno.EAFNOSUPPORT:
            text = f"{self.url.text}: the kernel of this system has no CAN; use a serial adapter (can://slcan/...)"
        elif number == errno.ENOENT:
            text = f"no such port: {name}; is the adapter plugged in?"
        else:
            text = f"cannot open {self.url.text}: {error}"
        return Unavailable(number or errno.EIO, text)

    def _link_gone(self, error: Exception) -> LinkGone:
        if _number_of(error) == errno.ENETDOWN:
            return LinkGone(
                f"{self.channel} is down: sudo ip link set {self.channel} up type can bitrate {self.baud}"
            )
        return LinkGone(f"{self.url.text}: {error}; was it unplugged?")

    def _full_text(self) -> str:
        return f"{self.url.text}: takes no more frames; is anything else on the bus, is it terminated?"


def silence_logger(library: str) -> None:
    """Keep the messages of a library out of our log; its exceptions hold the same information."""
    logger = logging.getLogger(library)
    logger.propagate = False
    if not logger.handlers:
        logger.addHandler(logging.NullHandler())


def can_port(port: Port) -> CanPort:
    """The port, if it moves CAN frames. Raises BadUrl when it does not."""
    if not isinstance(port, CanPort):
        raise BadUrl(f"{port.url.text} is no CAN bus: give a url such as can://socketcan/can0")
    return port


def _is_classic_data(message: can.Message) -> bool:
    return not (message.is_extended_id or message.is_remote_frame or message.is_error_frame or message.is_fd)


def _number_of(error: BaseException | None) -> int:
    """Return the errno of an error that python-can may have wrapped, 0 if none."""
    while error is not None:
        number = getattr(error, "errno", None) or getattr(error, "error_code", None)
        if isinstance(number, int):
            return number
        error = error.__cause__ or error.__context__
    return 0


def _parameters(module: str, name: str) -> set[str]:
    """Return the parameters of python-can's class of an interface; none when its library is missing."""
    silence_logger("can")
    try:
        kind = getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError, OSError):
        return set()
    return {parameter for base in kind.__mro__ for parameter in _parameters_of_class(base)} - _RESERVED


def _parameters_of_class(kind: type) -> Iterator[str]:
    """Yield the parameters of one class; those in `**kwargs` are found in its docstring."""
    made = kind.__dict__.get("__init__")
    if inspect.isfunction(made):
        named = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
        yield from (each.name for each in inspect.signature(made).parameters.values() if each.kind in named)
        yield from _DOCUMENTED.findall(f"{kind.__doc__} {made.__doc__}")


def _known_interfaces() -> str:
    return ", ".join(sorted(can.VALID_INTERFACES))
