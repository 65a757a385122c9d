"""The loudspeaker."""

from __future__ import annotations

from urbihw.buses.messages import Reply
from urbihw.kernel.uobject import function
from urbihw.platforms.speaker import PlatformSpeaker
from urbihw.platforms.spykee import protocol as p


class SpykeeSpeaker(PlatformSpeaker):
    """The loudspeaker of a Spykee, which also has sounds of its own."""

    play_rate = p.SOUND_RATE

    @function("playSound")
    def play_sound(self, id: int) -> None:
        """Play one of the robot's own sounds, 0 to 15 (0 alarm, 1 bomb, 2 laser, 3 laugh, 4 engine, 5 robot)."""
        if id not in p.SOUNDS:
            raise ValueError(f"there is no sound {id}; there are {p.SOUNDS[0]} to {p.SOUNDS[-1]}")
        self.channel.write("play", "sound", id, self._answered)

    def _answered(self, reply: Reply) -> None:
        if not reply.ok:
            self.log.warning("speaker: %s", reply.error)
