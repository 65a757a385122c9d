"""The robot behind its control connection: login, the effect of each packet, what it sends by itself.

It follows the fact sheet; where that leaves something open, it does what is worse for a driver: it drives on when the
connection is lost, closes the connection at a move before its first power packet, acknowledges nothing, cuts its
packets at odd places, skips pictures, and ends the music when a new file replaces the one that plays.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from struct import unpack

from urbihw_fakes.device import Answer, Device
from urbihw_fakes.spykee import camera, sound
from urbihw_fakes.spykee import packets as p
from urbihw_fakes.spykee.body import Body

UNIT = 0
"""The only unit there is, for faults."""
UID = "SPYKEE0011223344"
FIRST_POWER = 0.15
"""Seconds from the login to the first word about the battery."""
POWER_PERIOD = 10.0
FRAME_PERIOD = 0.05
LEFT_OUT = 9
"""Each such picture is left out, as a slow network does."""
PIECE = 2000
"""Samples of a packet of sound."""
LOOK_PERIOD = 0.05
"""Seconds between two looks whether it has found its dock."""
MUSIC = 64
MUSIC_RATE = 16_000
"""Bytes of music a second (128 kbit/s)."""
CUT_DELAY = 0.002
"""Seconds between the parts of a packet that is cut."""
REFUSED = p.frame(p.LOGIN_REPLY, b"\x03")


class Spykee(Device):
    """A Spykee.

    Attributes:
        body, microphone, speaker: its parts.
        on_close: what ends the connection; who serves it puts it here.
        user, password: who may come in; connected: the user that has, "" without one.
        leds, volume, sounds (ids that were played), files (by id), settings, networks, log_lines: what clients have
        sent. music: the files that were played; cut_music: how often a new file has ended the one that was playing.
        frames: pictures that were sent; dark: there is no light in the room but its own.
    """

    def __init__(
        self,
        uid: str = UID,
        user: str = "admin",
        password: str = "admin",
        *,
        body: Body | None = None,
        look: Callable[[bool], bytes] | None = None,
    ) -> None:
        """``look`` takes a picture, as ``camera.picture`` does; its argument is whether it is dark."""
        super().__init__()
        self.uid, self.user, self.password = uid, user, password
        self.body = body if body is not None else Body()
        self.speaker = sound.Speaker()
        self.microphone = sound.Microphone(self.speaker)
        self.on_close: Callable[[], None] = lambda: None
        self.connected = ""
        self.leds = {0: 0, 1: 0, 2: 0}
        self.volume = 0
        self.sounds: list[int] = []
        self.files: dict[int, bytes] = {}
        self.settings = {"name": "Spykee", "essid": "home"}
        self.networks = [("home", "WPA", 70), ("caf:e", "NONE", 31)]
        self.log_lines = ["boot", "network up"]
        self.music_ends: float | None = None
        self.music: list[bytes] = []
        self.cut_music = 0
        self.frames = 0
        self.pictures = look is not None or camera.has_pictures()
        self._look = look if look is not None else self._look_into_room
        self.dark = False
        self._streams: set[int] = set()
        self._seen = 0
        self._looked_at = 0.0
        self._uploading: dict[int, bytes] = {}
        self._cutter = p.Cutter()
        self._begin_session()

    def _begin_session(self) -> None:
        self.connected = ""
        self._streams.clear()
        self.speaker.switch(False)
        self._power_at: float | None = None
        self._ready_at = math.inf
        self._closes_at: float | None = None
        self._frame_at = self._piece_at = 0.0
        self._answers_free = 0.0

    # ---------------------------------------------------------------- the connection

    def connect(self) -> None:
        """A client has connected to the robot."""
        self._cutter = p.Cutter()
        self._begin_session()

    def disconnect(self) -> None:
        """The connection is gone; the motors go on."""
        self._begin_session()

    def discovered(self) -> bytes:
        """The answer to a question by UDP."""
        text = f"uid={self.uid}" + (f",connected-user={self.connected}" if self.connected else "")
        return b"DSCV\x02" + p.string(text)

    # ---------------------------------------------------------------- in

    def receive(self, data: bytes, now: float) -> list[Answer]:
        """Answer the packets that these bytes complete; a stream that is no longer in step closes the connection."""
        self.body.advance(now)
        if not self.body.powered:
            return []
        try:
            arrived = self._cutter.split(data)
        except p.Lost:
            self._close(now)
            return []
        return [answer for kind, payload in arrived for answer in self._handle_packet(kind, payload, now)]

    def _handle_packet(self, kind: int, payload: bytes, now: float) -> Iterator[Answer]:
        if self._closes_at is not None:
            return
        if kind == p.LOGIN:
            yield from self._log_in(payload, now)
        elif not self.connected or (kind == p.MOVE and now < self._ready_at):
            self._close(now)
        elif kind == p.CONFIGURATION:
            yield from self._configure(payload, now)
        elif kind == p.NETWORKS:
            rows = ";".join(f"{name}:{how}:{strength}" for name, how, strength in self.networks)
            yield from self._answer(p.NETWORKS, rows.encode("latin-1"), now)
        elif kind == p.LOG:
            yield from self._answer(p.LOG, "\n".join(self.log_lines).encode("latin-1"), now)
        else:
            self._apply_packet(kind, payload, now)

    def _log_in(self, payload: bytes, now: float) -> Iterator[Answer]:
        if payload != p.string(self.user) + p.string(self.password):
            yield from self._answer(p.LOGIN_REPLY, b"\x00", now)
            self._closes_at = now + 0.05
            return
        self._begin_session()
        self.connected = self.user
        names = p.string(self.uid) + p.string("Spykee") + p.string("") + p.string("1.0.34")
        yield from self._answer(p.LOGIN_REPLY, b"\x01" + names + bytes([0 if self.body.docked else 1]), now)
        self._ready_at = now + FIRST_POWER
        yield from self._answer(p.POWER, self.body.power_byte().to_bytes(1, "big", signed=True), self._ready_at)
        self._power_at = self._ready_at + POWER_PERIOD

    def _configure(self, payload: bytes, now: float) -> Iterator[Answer]:
        if payload:
            for row in payload.decode("latin-1").split("&"):
                key, _, value = row.partition("=")
                self.settings[key] = value
        else:
            rows = "&".join(f"{key}={value}" for key, value in self.settings.items())
            yield from self._answer(p.CONFIGURATION, rows.encode("latin-1"), now)

    def _apply_packet(self, kind: int, payload: bytes, now: float) -> None:
        """Apply a packet that has no answer."""
        if kind == p.MOVE and len(payload) == 2:
            left, right = unpack("bb", payload)
            self.body.drive(left, right)
        elif kind == p.LED and len(payload) == 2 and payload[0] in self.leds:
            self.leds[payload[0]] = payload[1]
        elif kind == p.VOLUME and len(payload) == 1:
            self.volume = payload[0]
        elif kind == p.AUDIO:
            self.speaker.feed(payload, now)
        elif kind == p.STREAM and len(payload) == 2:
            self._switch(payload[0], bool(payload[1]), now)
        elif kind == p.ENGINE and len(payload) == 1:
            self._engine(payload[0], now)
        elif kind == p.FILE and len(payload) >= 2:
            self._store(payload[0], payload[1], payload[2:])
        elif kind == p.PLAY and len(payload) == 1:
            self._play(payload[0], now)
        elif kind == p.STOP:
            self.music_ends = None

    def _switch(self, stream: int, on: bool, now: float) -> None:
        if stream == 3:
            self.speaker.switch(on)
        elif on and stream not in self._streams:
            self._streams.add(stream)
            if stream == 1:
                self._frame_at = now + FRAME_PERIOD
            else:
                self._piece_at = now + PIECE / sound.RATE
        elif not on:
            self._streams.discard(stream)

    def _engine(self, order: int, now: float) -> None:
        if order == 5:
            self.body.leave_dock(now)
        elif order == 6:
            self.body.find_dock()
        elif order == 7:
            self.body.cancel()

    def _store(self, number: int, flags: int, data: bytes) -> None:
        if number == MUSIC and self.music_ends is not None:
            self.music_ends = None
            self.cut_music += 1
        if flags & 1:
            self._uploading[number] = b""
        if number in self._uploading:
            self._uploading[number] += data
            if flags & 2:
                self.files[number] = self._uploading.pop(number)

    def _play(self, number: int, now: float) -> None:
        if number == MUSIC:
            if MUSIC in self.files:
                self.music.append(self.files[MUSIC])
                self.music_ends = now + len(self.files[MUSIC]) / MUSIC_RATE
        else:
            self.sounds.append(number)

    # ---------------------------------------------------------------- out

    def _answer(self, kind: int, payload: bytes, now: float) -> Iterator[Answer]:
        """A packet, cut into pieces that depend on its length, behind all that was said before."""
        delay, data = self.faults.disturb(UNIT, p.frame(kind, payload))
        at = max(now + delay, self._answers_free)
        cut = (len(data) * 7) % 11 + 1
        for part in (data[:cut], data[cut : 3 * cut], data[3 * cut :]):
            if part:
                yield Answer(at, part)
                self._answers_free = at
                at += CUT_DELAY if len(data) % 3 else 0.0

    def tick(self, now: float) -> list[Answer]:
        """Advance to `now`; return what is sent unasked: battery, dock, end of the music, pictures, sound."""
        self.body.advance(now)
        self._looked_at = now
        if self._closes_at is not None and now >= self._closes_at:
            self._close(now)
        if not self.connected or not self.body.powered:
            return []
        said: list[Answer] = []
        if self._power_at is not None and now >= self._power_at:
            said += self._answer(p.POWER, self.body.power_byte().to_bytes(1, "big", signed=True), now)
            self._power_at = now + POWER_PERIOD
        while self.body.news and now >= self._ready_at:
            said += self._answer(p.ENGINE, bytes([self.body.news.pop(0)]), now)
            self._power_at = now + 0.3
        if self.music_ends is not None and now >= self.music_ends:
            self.music_ends = None
            said += self._answer(p.STOP, b"", now)
        if 1 in self._streams and now >= self._frame_at:
            said += self._picture(now)
        while 2 in self._streams and now >= self._piece_at:
            heard = self.microphone.record(self._piece_at - PIECE / sound.RATE, PIECE)
            self._piece_at += PIECE / sound.RATE
            said += self._answer(p.AUDIO, heard, now)
        return said

    def _look_into_room(self, dark: bool) -> bytes:
        return camera.picture(self.body.x, self.body.y, self.body.heading, dark)

    def _picture(self, now: float) -> Iterator[Answer]:
        self._frame_at = max(self._frame_at + FRAME_PERIOD, now)
        self._seen += 1
        if self.pictures and self._seen % LEFT_OUT:
            data = self._look(self.dark and not self.leds[0])
            self.frames += 1
            yield from self._answer(p.VIDEO, data, now)

    def due(self) -> float | None:
        """Return the time of the next event: picture, sound, end of the music, news of the body."""
        times = [self._closes_at, self._power_at, self.music_ends]
        if self.connected:
            # The body may reach its dock at any time.
            if self.body.doing or self.body.news:
                times.append(max(self._ready_at, self._looked_at + LOOK_PERIOD))
            times += [self._frame_at if 1 in self._streams else None, self._piece_at if 2 in self._streams else None]
        return min((time for time in times if time is not None), default=None)

    def _close(self, now: float) -> None:
        self._begin_session()
        self.on_close()

    # ---------------------------------------------------------------- power

    def power_off(self, now: float, who: int | None = None) -> None:
        """Switch the power off: the robot coasts and falls silent, and the connection is not closed."""
        self.body.advance(now)
        self.body.cut_power()
        self._begin_session()

    def power_on(self, now: float, who: int | None = None) -> None:
        """Switch the power on: there is no connection any more."""
        self.body.advance(now)
        self.body.powered = True
        self._close(now)
