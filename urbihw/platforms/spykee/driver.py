"""The driver of a Spykee in the worker: logs in, sends the speeds periodically, reads the packets of the robot.

Devices and their items:

    trackL, trackR            target "speed", -100..100
    headLed, ledL, ledR       target "on", 0 or 1
    power                     "level", raw: percent, negative while it charges
    camera                    "image": the newest JPEG; sent while it is watched
    micro                     "piece0" to "piece7": (number, PCM), the newest eight; sent while it is watched

Requests: "write" of ("engine", "move") one of UNDOCK, DOCK, CANCEL; of ("play", "sound"), ("play", "stop"), ("play",
"volume"); of ("file", "chunk") (flags, bytes), ("speaker", "piece") bytes, ("speaker", "flush"); of ("config", KEY).
"read" of ("config", ""), ("networks", ""), ("log", ""), answered when the robot does.  Events (``DeviceReport``):
("dock", "docked"), ("dock", "undocked"), ("music", "ended").

Pictures and sound are samples: while the daemon does not read them, newer ones replace older ones.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

from urbihw.buses.driver import Driver, no_stop
from urbihw.buses.errors import BadFrame, BadValue, LinkGone
from urbihw.buses.halfpacket import HalfPacket
from urbihw.buses.link import Link, Port, byte_link
from urbihw.buses.messages import (
    Configure,
    DeviceReport,
    Found,
    FromWorker,
    Reply,
    Request,
    Samples,
    Watch,
)
from urbihw.buses.readings import Reading
from urbihw.platforms.spykee import protocol as p
from urbihw.platforms.spykee.bulk import PIECE_BYTES, SoundOut, Uploads
from urbihw.platforms.spykee.options import SpykeeOptions
from urbihw.platforms.spykee.session import SpykeeRobotInfo, log_in
from urbihw.platforms.spykee.tracks import LEFT, RIGHT, TrackSpeeds

TRACKS: Final = (LEFT, RIGHT)
POWER, CAMERA, MICRO, ENGINE = "power", "camera", "micro", "engine"
STREAMS: Final[Mapping[str, int]] = {CAMERA: p.CAMERA, MICRO: p.MICROPHONE}
ANSWER_TIMEOUT_S: Final = 3.0
"""Seconds to wait for configuration, networks or log."""
PIECES: Final = 8
"""Pieces of sound that are kept while the daemon does not read: a second."""
PACKETS_PER_TICK: Final = 2
"""Maximum packets of bulk data in a tick."""
_READ_BYTES: Final = 65536
_QUESTIONS: Final = {"config": p.CONFIGURATION, "networks": p.NETWORKS, "log": p.LOG}
_READERS: Final[Mapping[int, Callable[[bytes], Any]]] = {
    p.CONFIGURATION: p.read_configuration, p.NETWORKS: p.read_networks, p.LOG: p.read_log,
}  # fmt: skip


class SpykeeDriver(Driver):
    """Drives a Spykee over one TCP link; ``urbihw.buses.driver.Driver`` tells when each method is called."""

    logs_in = True
    device_info = SpykeeRobotInfo

    def __init__(self) -> None:
        self._link: Link | None = None
        self._framer = p.SpykeeFramer()
        self._half = HalfPacket()
        self._options = SpykeeOptions()
        self._tracks = TrackSpeeds()
        self._searching = self._docked = False
        self._watched: set[str] = set()
        self._leds: dict[str, int] = {}
        self._switches: list[bytes] = []
        self._uploads = Uploads()
        self._sound = SoundOut()
        # Packets that came with the last one of the login.
        self._early: list[tuple[int, bytes]] = []
        # (kind of the answer, request, until when) of each question.
        self._questions: list[tuple[int, int, float]] = []
        self._owed: list[FromWorker] = []
        self._piece = 0
        self._frames_dropped = 0
        self._unreadable = 0

    # ---------------------------------------------------------------- settings and the link

    def configure(self, settings: Configure) -> None:
        """Take settings.  Raises BadSetting for an option."""
        self._options = SpykeeOptions.of(settings.options)

    def attach(self, port: Port) -> list[FromWorker]:
        """Log in.  Raises Unavailable, BadUrl."""
        link = byte_link(port)
        self._framer = p.SpykeeFramer()
        self._tracks.reset()
        self._sound.reset()
        self._searching = False
        self._frames_dropped = self._unreadable = 0
        self._half = HalfPacket()
        info, self._early = log_in(link, self._framer, self._options.user, self._options.password)
        self._link = link
        self.identity = info.uid
        self._docked = info.docked
        # It may have been switched off meanwhile.
        self._switches = [_stream(device, True) for device in sorted(self._watched)]
        self._switches += [_light(led, on) for led, on in self._leds.items() if on]
        now = link.clock.now()
        return [Found((info,)), Samples(now, {POWER: {"level": info.power}}, {POWER: now})]

    def detach(self) -> None:
        """Release the port, which is closed: all requests fail, and only the watches and the lights stay."""
        self._link = None
        self._tracks.reset()
        self._searching = False
        self._owed += self._cancel_all("the link went down")

    def _cancel_all(self, reason: str) -> list[FromWorker]:
        asked, self._questions = self._questions, []
        gone: list[FromWorker] = [Reply(reply_id, False, error=reason) for _, reply_id, _ in asked]
        return gone + self._uploads.cancel_all(reason) + self._sound.cancel_all(reason)

    def reading(self, device: Any, item: str, raw: Any) -> Reading | None:
        """Return the charge of the battery."""
        return Reading("charge", abs(raw) / 100) if (device, item) == (POWER, "level") else None

    def errors(self) -> dict[str, int]:
        """Count pictures that were skipped because a newer one had come, packets that could not be read, and those that
        were not complete in time.
        """
        return {"skipped": self._frames_dropped, "unreadable": self._unreadable,
                "incomplete": self._half.dropped}  # fmt: skip

    # ---------------------------------------------------------------- one tick

    def tick(self, now: float, meanwhile: Callable[[], None], urgent: Callable[[], bool] = no_stop) -> list[FromWorker]:
        """Read the packets that have come, send what is due.  Raises LinkGone."""
        link = self._link
        news, self._owed = self._owed, []
        if link is None:
            return news
        values: dict[Any, dict[str, Any]] = {}
        data = link.read(_READ_BYTES, now)
        news += self._read_packets(data, values, link)
        move = self._tracks.next_packet(now)
        if move is not None:
            link.write(move)
        if self._switches:
            switches, self._switches = self._switches, []
            link.write(b"".join(switches))
        news += self._send_bulk(link, now, urgent)
        late = [row for row in self._questions if now > row[2]]
        self._questions = [row for row in self._questions if row not in late]
        news += [Reply(reply_id, False, error="the robot did not answer") for _, reply_id, _ in late]
        if values:
            news.append(Samples(now, values, dict.fromkeys(values, now)))
        return news

    def _send_bulk(self, link: Link, now: float, urgent: Callable[[], bool]) -> list[FromWorker]:
        """Send the music and sound that may leave now; returns the replies.  Raises LinkGone."""
        news: list[FromWorker] = []
        for _ in range(PACKETS_PER_TICK if self._sound.busy or self._uploads.busy else 0):
            if urgent() or not link.is_writable():
                break
            piece = self._sound.next_packet(now) or self._uploads.next_packet()
            if piece is None:
                break
            link.write(piece[0])
            news += piece[1]
        return news

    def _read_packets(self, data: bytes, values: dict[Any, dict[str, Any]], link: Link) -> list[FromWorker]:
        news: list[FromWorker] = []
        try:
            packets = self._early + self._framer.feed(data)
        except BadFrame as error:
            raise LinkGone(f"{link.url.text}: {error}; connecting again") from error
        self._early = []
        if self._half.is_overdue(len(packets), self._framer.held, link.clock.now()):
            self._framer.reset()
        for kind, payload in packets:
            if kind == p.VIDEO:
                camera = values.setdefault(CAMERA, {})
                self._frames_dropped += bool(camera)
                camera["image"] = payload
            elif kind == p.AUDIO:
                for at in range(0, len(payload), PIECE_BYTES):
                    self._piece += 1
                    piece = self._piece, payload[at : at + PIECE_BYTES]
                    values.setdefault(MICRO, {})[f"piece{self._piece % PIECES}"] = piece
            else:
                try:
                    news += self._handle_packet(kind, payload, values)
                except BadFrame:
                    self._unreadable += 1
        return news

    def _handle_packet(self, kind: int, payload: bytes, values: dict[Any, dict[str, Any]]) -> list[FromWorker]:
        """Process a packet that is neither picture nor sound.  Raises BadFrame."""
        if kind == p.POWER:
            values[POWER] = {"level": p.read_power(payload)}
        elif kind == p.ENGINE and payload[:1] == bytes([p.IS_DOCKED]):
            self._searching, self._docked = False, True
            if self._tracks.moving:
                self._tracks.halt()
                self.halted = "the robot is on its dock"
            return [DeviceReport("dock", "docked")]
        elif kind == p.ENGINE and payload[:1] == bytes([p.IS_UNDOCKED]):
            self._docked = False
            return [DeviceReport("dock", "undocked")]
        elif kind == p.STOP:
            return [DeviceReport("music", "ended")]
        elif kind in _READERS:
            answered = [row for row in self._questions if row[0] == kind]
            self._questions = [row for row in self._questions if row[0] != kind]
            value = _READERS[kind](payload)
            return [Reply(reply_id, True, value) for _, reply_id, _ in answered]
        return []

    # ---------------------------------------------------------------- what the parent wants

    def set_target(self, device: Any, item: str, value: Any) -> None:
        """Accept the speed of a track, which is dropped without a link, or a light, which is kept."""
        if device in TRACKS and item == "speed" and isinstance(value, int) and abs(value) <= p.FULL:
            if self._link is not None:
                self._tracks.set_speed(device, value)
        elif device in p.LEDS and item == "on" and value in (0, 1):
            self._leds[device] = value
            if self._link is not None:
                self._switches.append(_light(device, value))
        else:
            raise BadValue(f"no such target, or no such value: {value!r}")

    def watch(self, message: Watch, now: float) -> list[FromWorker]:
        """Switch pictures or sound on or off."""
        device = message.device
        if device not in STREAMS:
            return []
        wanted = message.period is not None
        (self._watched.add if wanted else self._watched.discard)(device)
        if self._link is not None:
            self._switches.append(_stream(device, wanted))
        return []

    def execute_request(self, message: Request) -> list[FromWorker]:
        """Execute one of the requests listed at the head of this file.  Raises LinkGone."""
        link = self._link
        if link is None:
            raise BadValue("the link is down")
        match message.verb, message.device, message.item:
            case "read", ("config" | "networks" | "log") as what, _:
                kind = _QUESTIONS[what]
                if all(row[0] != kind for row in self._questions):
                    link.write(p.packet(kind))
                self._questions.append((kind, message.reply_id, link.clock.now() + ANSWER_TIMEOUT_S))
                return []
            case "write", "file", "chunk":
                flags, data = message.value
                self._uploads.add_chunk(message.reply_id, flags, data)
                return []
            case "write", "speaker", "piece":
                error = self._sound.add_piece(message.reply_id, message.value)
                return [Reply(message.reply_id, False, error=error)] if error else []
            case "write", "speaker", "flush":
                return [*self._sound.cancel_all("it was stopped"), Reply(message.reply_id, True)]
            case "write", "config", key:
                link.write(p.pair(key, message.value))
            case "write", "engine", "move" if message.value in (p.UNDOCK, p.DOCK, p.CANCEL):
                self._searching = message.value == p.DOCK
                if message.value != p.CANCEL:
                    # A move after this request would end it, also one with speed 0.
                    self._tracks.reset()
                link.write(p.packet(p.ENGINE, bytes([message.value])))
            case "write", "play", "sound" if message.value in p.SOUNDS or message.value == p.MUSIC:
                link.write(p.packet(p.PLAY, bytes([message.value])))
            case "write", "play", "stop":
                link.write(p.packet(p.STOP))
            case "write", "play", "volume" if message.value in range(101):
                link.write(p.packet(p.VOLUME, bytes([message.value])))
            case _:
                what = f"{message.verb} {message.device} {message.item}"
                raise BadValue(f"this robot knows no request {what} {message.value!r:.40}")
        return [Reply(message.reply_id, True)]

    # ---------------------------------------------------------------- motion

    def safe_stop(self, devices: tuple[Any, ...] | None = None) -> None:
        """Stop the tracks at once, and a search for the dock, also one that it has begun itself.  Raises LinkGone."""
        self._tracks.halt(track for track in TRACKS if devices is None or track in devices)
        link = self._link
        if link is None:
            return
        if not self._docked and (devices is None or self._searching and ENGINE in devices):
            self._searching = False
            link.write(p.packet(p.ENGINE, bytes([p.CANCEL])))
        now = link.clock.now()
        move = self._tracks.next_packet(now)
        if move is not None:
            link.write(move)

    def stop_what_moves(self) -> tuple[Any, ...]:
        """Stop the robot in any case: the protocol does not tell whether an earlier client left it moving.

        Raises LinkGone.
        """
        self.safe_stop()
        return ()

    def moves(self, device: Any, item: str, value: Any) -> bool:
        """True for a speed other than zero."""
        return device in TRACKS and bool(value)

    def request_moves(self, request: Request) -> bool:
        """True for the search for the dock, and for leaving it."""
        return request.device == ENGINE and request.value in (p.UNDOCK, p.DOCK)


def _light(led: str, on: int) -> bytes:
    return p.packet(p.LED, bytes([p.LEDS[led], on]))


def _stream(device: str, on: bool) -> bytes:
    return p.packet(p.STREAM, bytes([STREAMS[device], on]))
