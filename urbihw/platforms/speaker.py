"""A loudspeaker that plays what programs assign to it: the sound is cut into pieces, of which the worker has some."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import ClassVar, Final

from urbihw.buses.messages import Reply
from urbihw.kernel.uobject import UObject, USound, function, owned, reading
from urbihw.platforms.channel import DeviceChannel
from urbihw.platforms.devicelog import DeviceLog
from urbihw.platforms.sound import SoundRecording

AHEAD: Final = 8
"""Pieces of sound that the worker has at most, in which this process may be held up."""
LONGEST_QUEUE_S: Final = 600.0
"""Seconds of sound that may wait for the loudspeaker."""


class PlatformSpeaker(UObject):
    """The loudspeaker: plays the sound that is assigned to ``val`` (raw or WAVE), behind what it plays already.

    ``remain`` (ms) is how much is left to play, ``playing`` whether there is any.  The worker of the robot has the
    requests "write" of ("speaker", "piece") with samples of 16 bits, answered when it wants the next piece, and of
    ("speaker", "flush").  A subclass sets ``play_rate``.
    """

    play_rate: ClassVar[int]
    """Samples a second that the worker takes."""

    val = owned()
    remain = reading(0.0)
    playing = reading(False)

    def init(self, channel: DeviceChannel, log: DeviceLog) -> None:
        """Speak to the worker through ``channel``."""
        self.channel, self.log = channel, log
        self._pieces: Iterator[bytes] = iter(())
        self._waiting: deque[SoundRecording] = deque()
        self._ahead = 0
        self._ends = 0.0
        self._epoch = 0
        self.notify_change(self.val, self._write)
        self.notify_access(self.remain, self._show_remain)

    def _write(self) -> None:
        sound = self.val.value
        if not isinstance(sound, USound):
            raise ValueError("this slot takes a sound: a Binary with the keywords raw or wav")
        recording = SoundRecording(sound, self.play_rate)
        now = self.host.now()
        if self._ends - now > LONGEST_QUEUE_S:
            raise ValueError(f"the loudspeaker has more than {LONGEST_QUEUE_S:g} s to play")
        self._ends = max(now, self._ends) + recording.seconds
        self._waiting.append(recording)
        self.playing.sense(True)
        self._feed()

    def _feed(self) -> None:
        while self._ahead < AHEAD:
            piece = next(self._pieces, None)
            if piece is None:
                if not self._waiting:
                    break
                self._pieces = self._waiting.popleft().pieces()
                continue
            self._ahead += 1
            epoch = self._epoch
            self.channel.write("speaker", "piece", piece, lambda reply, epoch=epoch: self._sent(reply, epoch))  # type: ignore[misc]
        if not self._ahead:
            self._show_end()

    def _sent(self, reply: Reply, epoch: int) -> None:
        if epoch != self._epoch:
            return
        self._ahead -= 1
        if reply.ok:
            self._feed()
        else:
            self.log.warning("speaker: not played: %s", reply.error)
            self._forget()

    def _show_end(self) -> None:
        """The last piece has left; it is over when it was played."""
        left = self._ends - self.host.now()
        if left <= 0:
            self.playing.sense(False)
            return
        handle = 0

        def over() -> None:
            self.remove_timer(handle)
            if not self._ahead and self.host.now() >= self._ends - 1e-6:
                self.playing.sense(False)

        handle = self.set_timer(left, over)

    def _show_remain(self) -> None:
        self.remain.sense(max(0.0, self._ends - self.host.now()) * 1000)

    def _forget(self) -> None:
        self._epoch += 1
        self._pieces, self._ahead, self._ends = iter(()), 0, 0.0
        self._waiting.clear()
        self.playing.sense(False)

    @function
    def stop(self) -> None:
        """Play no more of what was assigned; half a second may already be with the robot."""
        self._forget()
        self.channel.write("speaker", "flush", 0, lambda reply: None)
