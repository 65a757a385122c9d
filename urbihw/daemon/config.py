"""Every setting of the daemon, with its default.  A TOML file fills it, flags override the file.

The keys of the file are the names of the fields; a table ``[options]`` goes to the platform as it is::

    platform = "bioloid"
    url = "serial:///dev/ttyUSB0?baud=1000000"
    torque_off_on_stop = false

    [options]
    protocol = 1

Anything that cannot be meant (an unknown key, a wrong type, a port of 99999) raises BadConfig with one line that names
the file and the key.
"""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from urbihw.kernel.uobject import BadConfig

MIB = 1024 * 1024


@dataclass(frozen=True)
class Rule:
    """What a setting may be: ``wants`` says it in words; bounds are inclusive; ``make`` gives it its type."""

    kinds: tuple[type, ...]
    wants: str
    make: Callable[[Any], Any] = lambda value: value
    least: float | None = None
    most: float | None = None
    words: tuple[str, ...] = ()

    def accepts(self, value: object) -> bool:
        """Whether a value can be the setting.  A TOML boolean is no number."""
        if not isinstance(value, self.kinds) or (isinstance(value, bool) and bool not in self.kinds):
            return False
        if self.words and value not in self.words:
            return False
        if isinstance(value, int | float) and not isinstance(value, bool):
            return (self.least is None or value >= self.least) and (self.most is None or value <= self.most)
        if isinstance(value, list | tuple):
            return all(isinstance(part, str) for part in value)
        return True


TEXT = Rule((str,), "a text")
SWITCH = Rule((bool,), "true or false")
TEXTS = Rule((list, tuple), "a list of texts", tuple)
TABLE = Rule((dict,), "a table")


def _number(least: float, most: float, unit: str = "") -> Rule:
    return Rule((int, float), f"a number from {least:g} to {most:g}{unit}", float, least, most)


def _whole(least: int, most: int, unit: str = "") -> Rule:
    return Rule((int,), f"a whole number from {least} to {most}{unit}", least=least, most=most)


def _word(*words: str) -> Rule:
    return Rule((str,), "one of " + ", ".join(words), words=words)


def _setting(default: Any, rule: Rule) -> Any:
    return field(default=default, metadata={"rule": rule})


@dataclass(frozen=True)
class Config:
    """The settings.

    Attributes:
        platform: which robot to serve: the name of a folder of ``urbihw/platforms``; empty for none.
        url: of the robot's bus (see ``urbihw.buses``); empty for the platform's own default.
        fake: serve a robot in software instead; not together with ``url``.
        host: the address to listen on.  The default lets in only what runs on the same machine: urbiscript may do
            whatever the user may that the daemon runs as.
        port: the TCP port; 0 for any free one.
        port_file: where to write the port once clients can connect; empty for nowhere.
        quiet: no banner for new connections.
        load: urbiscript files to run before clients are let in.
        unread_limit: bytes that may wait for a client that does not read; then its connection is closed.
        rate: how often devices are read and written, in Hz.
        dead_man: seconds without a sign of life from the daemon after which the bus worker stops the robot; 0: never.
        torque_off_on_stop: stopping also switches the motors off; a robot that stands then falls.
        on_disconnect: what becomes of motion whose client is gone: "stop" (speeds go to zero, joints hold) or "keep".
        on_lost: what becomes of a movement whose device or link is lost: when that is back, the movement is taken up
            again ("resume"), or it is over ("end").
        limits: what each device may be asked for: see ``urbihw.platforms.limits``.
        control: path of the control socket of the bus worker; empty for ``control_path()``, "off" for none.
        log_level: the least important messages that are logged.
        options: what else the platform knows, by name.
    """

    platform: str = _setting("", TEXT)
    url: str = _setting("", TEXT)
    fake: bool = _setting(False, SWITCH)
    host: str = _setting("127.0.0.1", TEXT)
    port: int = _setting(54000, _whole(0, 65535))
    port_file: str = _setting("", TEXT)
    quiet: bool = _setting(False, SWITCH)
    load: tuple[str, ...] = _setting((), TEXTS)
    unread_limit: int = _setting(8 * MIB, _whole(4096, 1024 * MIB, " bytes"))
    rate: float = _setting(100.0, _number(1, 1000, " Hz"))
    dead_man: float = _setting(1.5, _number(0, 60, " s"))
    torque_off_on_stop: bool = _setting(False, SWITCH)
    on_disconnect: str = _setting("stop", _word("stop", "keep"))
    on_lost: str = _setting("resume", _word("resume", "end"))
    limits: dict[str, Any] = field(default_factory=dict, metadata={"rule": TABLE})
    control: str = _setting("", TEXT)
    log_level: str = _setting("info", _word("debug", "info", "warning", "error"))
    options: dict[str, Any] = field(default_factory=dict, metadata={"rule": TABLE})


RULES: dict[str, Rule] = {each.name: each.metadata["rule"] for each in fields(Config)}


def configure(file: Path | None = None, flags: Mapping[str, Any] | None = None) -> Config:
    """The settings from a file and from flags (by the names of the settings; None: not given), which win.

    Raises BadConfig.
    """
    values = {} if file is None else _checked(read_toml(file), str(file))
    given = {name: value for name, value in (flags or {}).items() if value is not None}
    typed = _checked(given, "")
    # A robot chosen on the command line replaces the one of the file, whichever way it was chosen there.
    if typed.get("url") or typed.get("fake"):
        values.pop("url", None)
        values.pop("fake", None)
    return Config(**{**values, **typed})


def read_toml(file: Path) -> dict[str, Any]:
    """The keys and values of a file.  Raises BadConfig if it cannot be read or is no TOML."""
    try:
        text = file.read_text("utf-8")
    except OSError as error:
        raise BadConfig(f"{file}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise BadConfig(f"{file}: is not UTF-8 text (byte {error.start})") from error
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise BadConfig(f"{file}: is not TOML: {error}") from error


def _checked(values: Mapping[str, Any], file: str) -> dict[str, Any]:
    """The values of one source, in the types of the settings; ``file`` is empty for flags."""
    checked = {}
    for key, value in values.items():
        if key not in RULES:
            raise BadConfig(f"{_place(key, file)}: no such setting{_guess(key)}")
        rule = RULES[key]
        if not rule.accepts(value):
            raise BadConfig(f"{_place(key, file)}: wants {rule.wants}, not {_shown(value)}")
        checked[key] = rule.make(value)
    if checked.get("url") and checked.get("fake"):
        raise BadConfig(f"{_place('fake', file)}: a fake robot has no url; give one or the other")
    return checked


def _place(key: str, file: str) -> str:
    return f"{file}: {key}" if file else "--" + key.replace("_", "-")


def _guess(key: str) -> str:
    close = difflib.get_close_matches(key, RULES, 1)
    return f"; did you mean {close[0]}?" if close else f"; there are: {', '.join(RULES)}"


def _shown(value: object) -> str:
    """A value as it is written in TOML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f'"{value}"'
    return "a table" if isinstance(value, dict) else str(value)
