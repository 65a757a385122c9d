"""The slots of the AX-S1: registers, views and meanings.  Sources: the manual's Bioloid chapter; e-manual, ax-s1."""

from __future__ import annotations

from typing import Final

from urbihw.platforms.servos.slots import COMMON, FAST, RARE, SLOW, Kind, RegisterSlot, View, keep


def bit(number: int) -> View:
    """One bit of a register, as a truth value."""
    return View(lambda si, facts: bool(int(si) >> number & 1), keep)


_SILENCE = 127.5
# The microphone swings around 127.5: its volume is the size of the swing, 0..1.
VOLUME: Final = View(lambda si, facts: abs(si - _SILENCE) / _SILENCE, keep)
# The largest sample so far; 0 restarts it.
LOUDEST: Final = View(
    lambda si, facts: max(0.0, si - _SILENCE) / _SILENCE,
    lambda value, facts: 0.0 if value == 0 else _SILENCE + value * _SILENCE,
)

AXS1: Final = (
    *COMMON,
    RegisterSlot("IRLeft", "ir_left", FAST),
    RegisterSlot("IRCenter", "ir_center", FAST),
    RegisterSlot("IRRight", "ir_right", FAST),
    RegisterSlot("lightLeft", "light_left", FAST),
    RegisterSlot("lightCenter", "light_center", FAST),
    RegisterSlot("lightRight", "light_right", FAST),
    RegisterSlot("obstacleLeft", "obstacle_detected", FAST, view=bit(0)),
    RegisterSlot("obstacleCenter", "obstacle_detected", FAST, view=bit(1)),
    RegisterSlot("obstacleRight", "obstacle_detected", FAST, view=bit(2)),
    RegisterSlot("lightDetectedLeft", "light_detected", FAST, view=bit(0)),
    RegisterSlot("lightDetectedCenter", "light_detected", FAST, view=bit(1)),
    RegisterSlot("lightDetectedRight", "light_detected", FAST, view=bit(2)),
    RegisterSlot("soundVolume", "sound", FAST, view=VOLUME),
    RegisterSlot("soundVolumeMax", "sound_max_hold", FAST, Kind.COUNTER, LOUDEST),
    RegisterSlot("clapCount", "sound_count", FAST, Kind.OWN),
    RegisterSlot("soundTime", "sound_time", FAST, Kind.COUNTER),
    RegisterSlot("obstacleThreshold", "obstacle_compare", SLOW, Kind.SETTING),
    RegisterSlot("lightThreshold", "light_compare", SLOW, Kind.SETTING),
    RegisterSlot("obstacleThresholdDefault", "obstacle_threshold", RARE, Kind.KEPT),
    RegisterSlot("lightThresholdDefault", "light_threshold", RARE, Kind.KEPT),
    RegisterSlot("lock", "lock", SLOW, Kind.COUNTER),
)

_SIDES: Final = ("Left", "Center", "Right")
WORDS: Final = {
    **{f"IR{side}": (f"reflected infrared light, {side.lower()}, 0 to 255", "1") for side in _SIDES},
    **{f"light{side}": (f"brightness, {side.lower()}, 0 to 255", "1") for side in _SIDES},
    **{f"obstacle{side}": (f"whether there is an obstacle, {side.lower()}", "") for side in _SIDES},
    **{f"lightDetected{side}": (f"whether it is bright, {side.lower()}", "") for side in _SIDES},
    "soundVolume": ("loudness of the present sound, 0 to 1", "ratio"),
    "soundVolumeMax": ("loudness of the loudest sound since 0 was written, 0 to 1", "ratio"),
    "clapCount": ("number of claps heard in a row; 0 may be written", "1"),
    "soundTime": ("time of the last clap", "s"),
    "obstacleThreshold": ("IR value from which it is an obstacle", "1"),
    "lightThreshold": ("brightness from which it is bright", "1"),
    "obstacleThresholdDefault": ("obstacleThreshold after the power is switched on", "1"),
    "lightThresholdDefault": ("lightThreshold after the power is switched on", "1"),
    "buzzerIndex": ("note to play, 0 to 51; melodies are played by playMelody", "1"),
    "buzzerTime": ("how long to play the note", "s"),
    "remocon": ("code received from, or to send to, a remote control", "1"),
    "remoconReceived": ("event: a code of a remote control was received", ""),
}
