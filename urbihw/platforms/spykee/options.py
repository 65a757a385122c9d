"""What the settings may say of a Spykee: ``[options]`` in ``urbihw.toml``."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from urbihw.frozen import frozen
from urbihw.settings import TEXT, Mistake, SettingRule, SettingsTable, number, setting, whole

_LONGEST = 255
_NO_TEXT = "\uffff"
"""Stands for what is no text."""


def _text(value: Any) -> str:
    return _NO_TEXT if isinstance(value, list | dict) else str(value)


_CREDENTIAL = SettingRule((str, int, float, bool, list, dict), "a text", _text)
"""A value of another type is refused by `SpykeeOptions.clashes`: the message of a rule would show it."""


@frozen(slots=False)
class SpykeeOptions(SettingsTable):
    """The options.

    Attributes:
        user: who logs in to the robot.
        password: of that user; it travels in clear, and is never logged.
        volume: of the loudspeaker when the robot is found, 0 to 100.
        calibration: the file that keeps calibrations, "" for one in the folder of the service or of the user.
        full_speed: m/s of both tracks at 100, before a calibration.
        full_turn: rad/s on the spot with the tracks at 100 and -100, before a calibration.
    """

    user: str = setting("admin", _CREDENTIAL)
    password: str = setting("admin", _CREDENTIAL, secret=True)
    volume: int = setting(50, whole(0, 100))
    calibration: str = setting("", TEXT, file=True)
    full_speed: float = setting(0.4, number(0.01, 5, " m/s"))
    full_turn: float = setting(2.0, number(0.01, 50, " rad/s"))

    def clashes(self) -> Iterator[Mistake]:
        """Yield user names and passwords that are too long for the protocol or outside ISO-8859-1."""
        for name in ("user", "password"):
            text = getattr(self, name)
            if len(text) > _LONGEST or any(ord(letter) > 255 for letter in text):
                yield Mistake(name, f"wants a text of at most {_LONGEST} letters of ISO-8859-1")
