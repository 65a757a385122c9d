"""Every setting of the daemon, with its default.  A TOML file fills it, flags override the file.

The keys of the file are the names of the fields; the platform says which ``[options]`` and ``[limits]`` there are::

    platform = "bioloid"
    url = "serial:///dev/ttyUSB0?baud=1000000"
    torque_off_on_stop = false

    [options]
    protocol = 1

Anything that cannot be meant (an unknown key, a wrong type, a port of 99999, an option or a limit that the platform
does not have, an unknown parameter of the url) raises BadConfig with one line that names the file and the key.  What is
wrong is known before anything is opened; ``load`` tells all of it, ``configure`` the first.
"""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from urbihw import buses, platforms
from urbihw.buses.errors import BadUrl, Unavailable
from urbihw.buses.link import Context, take_off
from urbihw.daemon.files import read_regular, unreadable
from urbihw.kernel.server.bounds import HOLD_LIMIT, MAX_JOBS, MEMORY_LIMIT, MOST_JOBS
from urbihw.kernel.uobject import BadConfig
from urbihw.settings import (
    SWITCH,
    TABLE,
    TEXT,
    TEXTS,
    Mistake,
    Table,
    choice,
    from_texts,
    number,
    one_line,
    setting,
    whole,
)

MIB = 1024 * 1024
LONGEST_FILE = 64 * 1024
"""Bytes of a file of settings."""
_TABLES = ("options", "limits")


@dataclass(frozen=True)
class Config(Table):
    """The settings.

    Attributes:
        platform: which robot to serve: the name of a folder of ``urbihw/platforms``; empty for none.
        url: of the robot's bus (see ``urbihw.buses``); empty for the platform's own default.
        fake: serve a robot in software instead; not together with ``url``.
        host: the address to listen on.  The default lets in only what runs on the same machine: urbiscript may do
            whatever the user may that the daemon runs as.
        allow_plain: on an address that others can reach, let anybody in, without TLS and token.
        tls_cert: file of a certificate in PEM, for such an address; empty for one that the daemon makes itself.
        tls_key: file of its key; empty if that is in ``tls_cert``, too.
        port: the TCP port; 0 for any free one.
        port_file: where to write the port once clients can connect; empty for nowhere.
        quiet: no banner for new connections.
        load: urbiscript files to run before clients are let in.
        socket: path of the UNIX socket for clients; empty for ``client_path()``, "off" for none.
        max_clients: how many clients there may be; one more is told so and closed.
        hold_limit: seconds that a job may keep all others waiting; then it gets an error, and is ended if it goes on
            all the same; 0: as long as it wants.  After ``dead_man`` seconds of it the bus worker stops the robot.
        max_jobs: how many jobs one connection may have at the same time; more are refused to it.
        memory_limit: MiB of memory that the daemon may have, at most half of what the machine has; beyond it, who takes
            more gets an error; 0: any amount.
        unread_limit: bytes that may wait for a client to read them.  At half of it the client's own jobs wait as well;
            what others say to it closes its connection when the limit is passed.
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

    platform: str = setting("", TEXT)
    url: str = setting("", TEXT)
    fake: bool = setting(False, SWITCH)
    host: str = setting("127.0.0.1", TEXT)
    allow_plain: bool = setting(False, SWITCH)
    tls_cert: str = setting("", TEXT)
    tls_key: str = setting("", TEXT)
    port: int = setting(54000, whole(0, 65535))
    port_file: str = setting("", TEXT)
    quiet: bool = setting(False, SWITCH)
    load: tuple[str, ...] = setting((), TEXTS)
    unread_limit: int = setting(8 * MIB, whole(4096, 1024 * MIB, " bytes"))
    rate: float = setting(100.0, number(1, 1000, " Hz"))
    dead_man: float = setting(1.5, number(0, 60, " s"))
    torque_off_on_stop: bool = setting(False, SWITCH)
    on_disconnect: str = setting("stop", choice("stop", "keep"))
    on_lost: str = setting("resume", choice("resume", "end"))
    limits: dict[str, Any] = setting({}, TABLE)
    control: str = setting("", TEXT)
    log_level: str = setting("info", choice("debug", "info", "warning", "error"))
    options: dict[str, Any] = setting({}, TABLE)
    socket: str = setting("", TEXT)
    max_clients: int = setting(256, whole(1, 10_000))
    hold_limit: float = setting(HOLD_LIMIT, number(0, 3600, " s"))
    max_jobs: int = setting(MAX_JOBS, whole(10, MOST_JOBS))
    memory_limit: int = setting(MEMORY_LIMIT, whole(0, 1_000_000, " MiB"))

    def clashes(self) -> Iterator[Mistake]:
        """See ``Table``."""
        if self.url and self.fake:
            yield Mistake("fake", "a fake robot has no url; give one or the other")
        if self.tls_key and not self.tls_cert:
            yield Mistake("tls_key", "there is no tls_cert that it belongs to; give both, or none to have one made")


class Complaint(NamedTuple):
    """A mistake, as a line for the user; ``setting`` is the name of the setting, "" for the file as a whole."""

    setting: str
    line: str


@dataclass(frozen=True)
class Loaded:
    """What came of a file and flags.

    Attributes:
        config: the settings in force; a mistake leaves a setting at its default.
        file: the file, "" for none.
        in_file: the settings that it gives.
        flags: the settings that flags give, which win.
        mistakes: all of them.
    """

    config: Config
    file: str
    in_file: Collection[str]
    flags: Collection[str]
    mistakes: tuple[Complaint, ...]

    def source(self, key: str) -> str:
        """Where a setting, or a row of a table, comes from: ``robot.toml: options.ids``, ``--port`` or ``default``."""
        setting = key.partition(".")[0]
        if setting in self.flags:
            return _place(key, "")
        return _place(key, self.file) if setting in self.in_file else "default"


class Entry(NamedTuple):
    """A setting in force: its name (``options.protocol`` in a table), its value, and where that comes from.

    ``note`` is what follows from it together with others, "" for nothing that one would not expect.
    """

    key: str
    value: Any
    source: str
    note: str = ""


def configure(file: Path | None = None, flags: Mapping[str, Any] | None = None) -> Config:
    """The settings from a file and from flags (by the names of the settings; None: not given), which win.

    Raises BadConfig for the first mistake.
    """
    loaded = load(file, flags)
    if loaded.mistakes:
        raise BadConfig(loaded.mistakes[0].line)
    return loaded.config


def load(file: Path | None = None, flags: Mapping[str, Any] | None = None) -> Loaded:
    """The same with all mistakes, and with where each setting comes from."""
    name = "" if file is None else str(file)
    mistakes: list[Complaint] = []
    in_file: dict[str, Any] = {}
    if file is not None:
        try:
            in_file = read_toml(file)
        except BadConfig as error:
            mistakes.append(Complaint("", one_line(str(error))))
    values, wrong = _read(in_file, name)
    typed, wrong_flags = _read({key: value for key, value in (flags or {}).items() if value is not None}, "")
    # A robot chosen on the command line replaces the one of the file, whichever way it was chosen there.
    if typed.get("url") or typed.get("fake"):
        values.pop("url", None)
        values.pop("fake", None)
    config = Config(**{**values, **typed})
    of_robot = [
        Complaint(top, one_line(f"{_place(each.key, '' if top in typed else name)}: {each.text}"))
        for each in _mistakes_about_robot(config)
        for top in [each.key.partition(".")[0]]
    ]
    return Loaded(config, name, values.keys(), typed.keys(), (*mistakes, *wrong, *wrong_flags, *of_robot))


def entries(loaded: Loaded) -> Iterator[Entry]:
    """Every setting in force, with the options of the platform and the limits that were given."""
    config = loaded.config
    manifest = platforms.find(config.platform) if config.platform else None
    for key in Config.rules():
        value = getattr(config, key)
        if key == "url" and not value and not config.fake and manifest is not None and manifest.default_url:
            yield Entry(key, manifest.default_url, f"default of {manifest.name}")
        elif key not in _TABLES:
            note = _note_of_hold(config) if key == "hold_limit" else ""
            yield Entry(key, value, loaded.source(key), note)
    if manifest is not None:
        yield from _options_in_force(loaded, platforms.load_options(manifest))
    for key, value in config.limits.items():
        rows = {f".{kind}": row for kind, row in value.items()} if isinstance(value, dict) else {"": value}
        for kind, row in rows.items():
            yield Entry(f"limits.{key}{kind}", row, loaded.source(f"limits.{key}{kind}"))


def _note_of_hold(config: Config) -> str:
    """A job that holds the interpreter makes the daemon silent, and the bus worker waits for dead_man only."""
    if not config.dead_man or 0 < config.hold_limit <= config.dead_man:
        return ""
    return f"a job that holds for longer than dead_man ({config.dead_man:g} s) stops the robot before"


def _options_in_force(loaded: Loaded, table: type[Table]) -> Iterator[Entry]:
    given = loaded.config.options
    _, in_url = take_off(loaded.config.url, table.in_url())
    made = table.of(from_texts(table.rules(), in_url, "parameter")[0] | given)
    for key in table.rules():
        source = f"options.{key}" if key in given else "url" if key in in_url else ""
        yield Entry(f"options.{key}", getattr(made, key), loaded.source(source))


def read_toml(file: Path) -> dict[str, Any]:
    """The keys and values of a file.  Raises BadConfig if it cannot be read or is no TOML."""
    try:
        text = read_regular(file, LONGEST_FILE).data.decode("utf-8")
    except FileNotFoundError as error:
        raise unreadable(file, error) from error
    except UnicodeDecodeError as error:
        raise BadConfig(f"{file}: is not UTF-8 text (byte {error.start})") from error
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # ValueError also of a number with thousands of digits
        raise BadConfig(f"{file}: is not TOML: {error}") from error


def _read(given: Mapping[str, Any], file: str) -> tuple[dict[str, Any], list[Complaint]]:
    """What one source says, in the types of the settings, and what is wrong with it; ``file`` is empty for flags."""
    made, mistakes = Config.read(given, "setting")
    wrong = {each.key for each in mistakes}
    values = {key: getattr(made, key) for key in given if key not in wrong}
    return values, [Complaint(each.key, one_line(f"{_place(each.key, file)}: {each.text}")) for each in mistakes]


def _mistakes_about_robot(config: Config) -> Iterator[Mistake]:
    """What is wrong with the settings that only the platform and the bus know."""
    options = Table
    try:
        manifest = platforms.find(config.platform) if config.platform else None
        if manifest is not None:
            options = platforms.load_options(manifest)
    except BadConfig as error:
        yield Mistake("platform", str(error))
        return
    yield from platforms.mistakes(manifest, config.options, config.limits)
    if manifest is None:
        for top in _TABLES:
            if getattr(config, top):
                yield Mistake(top, "cannot be checked without a platform; add platform = ..., or say --platform")
    if manifest is not None and config.fake and not manifest.fake:
        yield Mistake("fake", f"platform {manifest.name} has no robot in software; give its url")
    if config.url:
        yield from _mistakes_in_url(config.url, options)


def _mistakes_in_url(url: str, options: type[Table]) -> Iterator[Mistake]:
    try:
        port, own = take_off(url, options.in_url())
        values, mistakes = from_texts(options.rules(), own, "parameter")
        yield from (Mistake("url", str(each)) for each in mistakes or options.read(values, "parameter")[1])
        buses.port_for(port, Context())
    except (BadUrl, Unavailable) as error:
        yield Mistake("url", str(error))


def _place(key: str, file: str) -> str:
    return f"{file}: {key}" if file else "--" + key.replace("_", "-")
