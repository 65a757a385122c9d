"""Every setting of the daemon, with its default.  A TOML file fills it, flags override the file.

The keys of the file are the names of the fields; the platform says which ``[options]`` and ``[limits]`` there are, and
whether there are ``[devices]``::

    platform = "bioloid"
    url = "serial:///dev/ttyUSB0?baud=1000000"
    torque_off_on_stop = false

    [options]
    protocol = 1

Invalid input (an unknown key, a wrong type, a port of 99999, an option or a limit that the platform does not have, an
unknown parameter of the url) raises BadConfig with one line that names the file and the key.  All mistakes are found
before anything is opened; ``load`` reports all of them, ``configure`` the first.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from urbihw import buses, platforms
from urbihw.buses.errors import BadUrl, Unavailable
from urbihw.buses.link import Context, split_parameters
from urbihw.client.where import is_loopback
from urbihw.daemon import timeouts
from urbihw.daemon.files import read_regular, unreadable
from urbihw.daemon.metrics import parse_address
from urbihw.fleets.names import DEFAULT_ENDPOINT, NAME_PATTERN, checked_endpoint, checked_fleet_name
from urbihw.frozen import frozen
from urbihw.kernel.server.bounds import HOLD_LIMIT, MAX_JOBS, MAX_TOTAL_JOBS, MEMORY_LIMIT
from urbihw.kernel.uobject import BadConfig
from urbihw.settings import (
    SWITCH,
    TABLE,
    TEXT,
    TEXTS,
    Mistake,
    SettingsTable,
    choice,
    from_texts,
    number,
    one_line,
    setting,
    whole,
)

MIB = 1024 * 1024
MAX_FILE_BYTES = 64 * 1024
"""Maximum size of a settings file in bytes."""
MAX_DEPTH = 32
"""Maximum nesting depth of lists and tables, and maximum number of parts of a dotted key.  Settings need three; the
time of the TOML parser grows with the square of the depth."""
_OCTET = "(25[0-5]|2[0-4][0-9]|1[0-9][0-9]|[1-9]?[0-9])"
_PORT = "(6553[0-5]|655[0-2][0-9]|65[0-4][0-9]{2}|6[0-4][0-9]{3}|[1-5][0-9]{4}|[1-9][0-9]{0,3})"
METRICS = replace(TEXT, pattern=rf"^$|^(127(\.{_OCTET}){{3}}|\[::1\]):{_PORT}$")
"""The rule of ``metrics``, whose reasons ``parse_address`` tells: an address of this machine alone, and a port."""
FLEET_NAME = replace(TEXT, pattern=rf"^$|^{NAME_PATTERN}$")
FLEET_NAMES = replace(TEXTS, each=replace(TEXT, pattern=rf"^{NAME_PATTERN}$"))
_TABLES = ("options", "limits", "devices")
_NESTING = re.compile(
    r"""(?:\"{3}[\s\S]*?\"{3}|'{3}[\s\S]*?'{3}|"(?:\\.|[^"\\\n])*+"|'[^'\n]*+'|\#[^\n]*+)"""  # strings and comments
    r"""|([\[{])|([\]}])"""
    rf"""|((?:\.[ \t]*+(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+){{{MAX_DEPTH}}})"""
)
"""The groups that matter for the depth: an opening bracket, a closing one, a key of too many parts."""


@frozen(slots=False)
class Config(SettingsTable):
    """The settings of the daemon.

    Attributes:
        platform: the robot to serve: the name of a folder of ``urbihw/platforms``; empty for none.
        url: url of the robot's bus (``urbihw.buses``); empty for the platform's own default.
        fake: serve a simulated robot instead; not together with ``url``.
        world: the simulated world of that robot's body: a name such as ``room``, or a file of MuJoCo; empty for none.
        host: the address to listen on.  The default accepts only clients on the same machine: urbiscript has all rights
            of the user that runs the daemon.
        allow_plain: accept every client, without TLS and token, on an address that other machines can reach.
        tls_cert: file of a certificate in PEM, for such an address; empty for one that the daemon makes itself.
        tls_key: file of the key of the certificate; empty if ``tls_cert`` contains it.
        port: the TCP port; 0 for any free one.
        port_file: file to which the port is written once clients can connect; empty for none.
        quiet: no banner and no hints behind errors for connections.
        load: urbiscript files to run before clients can connect.
        socket: path of the UNIX socket for clients; empty for ``client_path()``, "off" for none.
        max_clients: maximum number of clients; further ones get a line that says so and are disconnected.
        hold_limit: seconds of processor time for which a job may block all others; then it gets an error, and is ended
            if it goes on; 0: no limit, and a job that blocks for ``dead_man`` seconds stops the robot.  At most half of
            ``dead_man``; by default a third of it, 0.5 s at most (``urbihw.daemon.timeouts``).
        max_jobs: maximum number of simultaneous jobs of one connection; further ones are refused.
        memory_limit: maximum memory of the daemon in MiB, at most half of the machine's memory; beyond it, jobs that
            allocate more get an error; 0: no limit.
        unread_limit: maximum unread output of a client in bytes.  At half of it the client's own jobs wait when they
            write; output of other jobs beyond the limit closes the connection.
        rate: frequency of reading and writing devices, in Hz.
        realtime: the bus worker takes real-time scheduling, else a niceness, where the system allows it.
        dead_man: seconds without a sign of life from the daemon after which the bus worker stops the robot; 0: never.
        torque_off_on_stop: a stop also switches the motors off; a standing robot then falls.
        on_disconnect: the effect of a disconnect on the client's motions: "stop" (speeds go to zero, joints hold) or
            "keep".
        on_lost: the effect of the loss of a device or link on a movement: it continues when the device is back
            ("resume"), or it is ended ("end").
        limits: the limits of each device for requested values (``urbihw.platforms.limits``).
        devices: the expected devices of a chain of servos: name -> id, or a table (``urbihw.platforms.expected``).
        motions: folder of the recorded motions and poses of the robot; empty for one in the state folder.
        control: path of the control socket of the bus worker; empty for ``control_path()``, "off" for none.
        metrics: address and port of this machine for ``/metrics``, such as ``127.0.0.1:9100``; empty for none.
        web: serve the panel for browsers, in a process of its own.
        ros: "auto" serves the robot as a node of ROS, in a process of its own; "off" does not.
        flight: seconds that the flight recorder keeps in memory, in a process of its own; 0 for no flight recorder.
        panel_host: the address on which browsers are served; others than this machine get TLS.
        panel_port: the port on which browsers are served.
        panel_speed: speed of joints that a browser of role drive may ask for at most, rad/s.
        fleet: the fleet that the robot belongs to, by a bridge in a process of its own; empty for none.
        name: the name of the robot in its fleet; empty for that of the host.
        fleet_endpoint: where the fleet meets, on this machine alone.
        fleet_hz: how often the values are published, in Hz.
        fleet_drive: names of the members of the fleet that may drive this robot; all others only look, and stop.
        fleet_dead_man: seconds without a sign of life after which a far member that drives loses what it moves.
        announce: announce the port in the network, if other machines reach it (``urbihw find``).
        log_level: the minimum level of logged messages.
        options: further settings that the platform defines, by name.
    """

    platform: str = setting("", TEXT)
    url: str = setting("", TEXT)
    fake: bool = setting(False, SWITCH)
    world: str = setting("", TEXT)
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
    realtime: bool = setting(True, SWITCH)
    dead_man: float = setting(1.5, number(0, 60, " s"))
    torque_off_on_stop: bool = setting(False, SWITCH)
    on_disconnect: str = setting("stop", choice("stop", "keep"))
    on_lost: str = setting("resume", choice("resume", "end"))
    limits: dict[str, Any] = setting({}, TABLE)
    devices: dict[str, Any] = setting({}, TABLE)
    motions: str = setting("", TEXT)
    control: str = setting("", TEXT)
    metrics: str = setting("", METRICS)
    web: bool = setting(False, SWITCH)
    ros: str = setting("off", choice("off", "auto"))
    flight: float = setting(0.0, number(0, 3600, " s"))
    panel_host: str = setting("127.0.0.1", TEXT)
    panel_port: int = setting(54080, whole(1, 65535))
    panel_speed: float = setting(1.0, number(0.01, 100, " rad/s"))
    fleet: str = setting("", FLEET_NAME)
    name: str = setting("", FLEET_NAME)
    fleet_endpoint: str = setting(DEFAULT_ENDPOINT, TEXT)
    fleet_hz: float = setting(10.0, number(0.1, 100, " Hz"))
    fleet_drive: tuple[str, ...] = setting((), FLEET_NAMES)
    fleet_dead_man: float = setting(0.5, number(0.2, 10, " s"))
    announce: bool = setting(False, SWITCH)
    log_level: str = setting("info", choice("debug", "info", "warning", "error"))
    options: dict[str, Any] = setting({}, TABLE)
    socket: str = setting("", TEXT)
    max_clients: int = setting(256, whole(1, 10_000))
    hold_limit: float = setting(HOLD_LIMIT, number(0, 3600, " s"))
    max_jobs: int = setting(MAX_JOBS, whole(10, MAX_TOTAL_JOBS))
    memory_limit: int = setting(MEMORY_LIMIT, whole(0, 1_000_000, " MiB"))

    def clashes(self) -> Iterator[Mistake]:
        """The conflicts between settings that are valid by themselves."""
        if self.url and self.fake:
            yield Mistake("fake", "a fake robot has no url; give one or the other")
        if self.world and not self.fake:
            yield Mistake("world", "only a simulated robot has a world; give fake, too")
        if not self.host.isprintable() or " " in self.host:
            yield Mistake("host", f"wants an address or a name, such as 127.0.0.1 or ::1, not {self.host!r}")
        if self.tls_key and not self.tls_cert:
            yield Mistake("tls_key", "there is no tls_cert that it belongs to; give both, or none to have one made")
        if self.metrics:
            try:
                parse_address(self.metrics)
            except ValueError as error:
                yield Mistake("metrics", str(error))
        if self.web and self.socket == "off" and not is_loopback(self.host):
            yield Mistake("web", "the panel needs the UNIX socket, since others than this machine reach host; leave "
                          "socket out")
        if self.ros != "off" and self.socket == "off" and not is_loopback(self.host):
            yield Mistake("ros", "the node needs the UNIX socket, since others than this machine reach host; leave "
                          "socket out")
        if not self.panel_host.isprintable() or not self.panel_host or " " in self.panel_host:
            yield Mistake("panel_host", f"wants an address, such as 127.0.0.1 or 0.0.0.0, not {self.panel_host!r}")
        yield from self._clashes_of_fleet()
        if self.flight and self.control == "off":
            yield Mistake("flight", "it reads the bus worker, which has no control socket; leave control out")
        if self.metrics and self.control == "off":
            yield Mistake("metrics", "they are those of the bus worker, which has no control socket; leave control out")

    def _clashes_of_fleet(self) -> Iterator[Mistake]:
        for key, check, values in (
            ("fleet", checked_fleet_name, (self.fleet,) if self.fleet else ()),
            ("name", checked_fleet_name, (self.name,) if self.name else ()),
            ("fleet_drive", checked_fleet_name, self.fleet_drive),
            ("fleet_endpoint", checked_endpoint, (self.fleet_endpoint,)),
        ):
            for each in values:
                try:
                    check(each)
                except ValueError as error:
                    yield Mistake(key, str(error))
                    break
        if self.fleet and self.control == "off":
            yield Mistake("fleet", "a stop for all goes to the bus worker, which has no control socket; leave control "
                          "out")


class Complaint(NamedTuple):
    """A mistake as a line for the user; ``setting`` is the name of the setting, "" for the file as a whole."""

    setting: str
    line: str


@frozen(slots=False)
class Loaded:
    """The result of loading a file and flags.

    Attributes:
        config: the settings in force; a mistake leaves a setting at its default.
        file: the file, "" for none.
        in_file: the settings that the file contains.
        flags: the settings given by flags, which override the file.
        mistakes: all mistakes.
    """

    config: Config
    file: str
    in_file: Collection[str]
    flags: Collection[str]
    mistakes: tuple[Complaint, ...]

    def source(self, key: str) -> str:
        """The source of a setting or of a row of a table: ``robot.toml: options.ids``, ``--port`` or ``default``."""
        setting = key.partition(".")[0]
        if setting in self.flags:
            return _place(key, "")
        return _place(key, self.file) if setting in self.in_file else "default"


class SettingInForce(NamedTuple):
    """A setting in force: its name (``options.protocol`` in a table), its value, and the source of the value.

    ``note`` is an unexpected consequence of the setting together with others, "" for none.  The value of a secret is
    None.
    """

    key: str
    value: Any
    source: str
    note: str = ""


def configure(file: Path | None = None, flags: Mapping[str, Any] | None = None) -> Config:
    """The settings from a file and from flags (by the names of the settings; None: not given), which override the file.

    Raises BadConfig for the first mistake.
    """
    return load_faultless(file, flags).config


def load_faultless(file: Path | None = None, flags: Mapping[str, Any] | None = None) -> Loaded:
    """Load the settings like ``configure``, with the source of each setting."""
    loaded = load(file, flags)
    if loaded.mistakes:
        raise BadConfig(loaded.mistakes[0].line)
    return loaded


def load(file: Path | None = None, flags: Mapping[str, Any] | None = None) -> Loaded:
    """Load the settings like ``configure``, with all mistakes and the source of each setting."""
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
    # A robot chosen on the command line replaces the one of the file, whether the file has a url or ``fake``.
    if typed.get("url") or typed.get("fake"):
        values.pop("url", None)
        values.pop("fake", None)
        values.pop("world", None)
    config = Config(**{**values, **typed})
    if "hold_limit" not in {*values, *typed}:
        config = replace(config, hold_limit=timeouts.default_hold_limit(_dead_man(config)))
    if file is not None and "options" in values:
        config = replace(config, options=_files_beside(file, config))
    of_robot = [
        Complaint(top, one_line(f"{_place(each.key, '' if top in typed else name)}: {each.text}"))
        for each in _mistakes_about_robot(config)
        for top in [each.key.partition(".")[0]]
    ]
    return Loaded(config, name, values.keys(), typed.keys(), (*mistakes, *wrong, *wrong_flags, *of_robot))


def unusable_files(loaded: Loaded) -> Iterator[Complaint]:
    """The files that the options name and that the start would refuse; this opens them."""
    config = loaded.config
    if not config.platform or any(each.setting in ("platform", "options") for each in loaded.mistakes):
        return
    table = platforms.load_options(platforms.find(config.platform))
    for each in table.of(config.options).unusable_files():
        key = f"options.{each.key}"
        yield Complaint("options", one_line(f"{_place(key, loaded.file)}: {each.text}"))


def _dead_man(config: Config) -> float:
    """The dead man's time of the robot in s; that of the settings if the platform is unknown, which is reported
    elsewhere.
    """
    try:
        manifest = platforms.find(config.platform) if config.platform else None
    except BadConfig:
        manifest = None
    return timeouts.dead_man_in_force(config.dead_man, manifest)


def _files_beside(settings: Path, config: Config) -> dict[str, Any]:
    """The options, with the files that the platform wants named from the folder of the settings file."""
    try:
        names = platforms.load_options(platforms.find(config.platform)).files()
    except BadConfig:  # an unknown platform, which is reported elsewhere
        return config.options
    folder = settings.absolute().parent
    return {
        key: str(folder / value) if key in names and isinstance(value, str) and value else value
        for key, value in config.options.items()
    }


def entries(loaded: Loaded) -> Iterator[SettingInForce]:
    """All settings in force, with the options of the platform and the given limits."""
    config = loaded.config
    manifest = platforms.find(config.platform) if config.platform else None
    for key in Config.rules():
        value = getattr(config, key)
        if key == "url" and not value and not config.fake and manifest is not None and manifest.default_url:
            yield SettingInForce(key, manifest.default_url, f"default of {manifest.name}")
        elif key not in _TABLES:
            note = _note_of_hold(config) if key == "hold_limit" else ""
            yield SettingInForce(key, value, loaded.source(key), note)
    if manifest is not None:
        yield from _options_in_force(loaded, platforms.load_options(manifest))
    for top, table in (("limits", config.limits), ("devices", config.devices)):
        for key, value in table.items():
            rows = {f".{kind}": row for kind, row in value.items()} if isinstance(value, dict) else {"": value}
            for kind, row in rows.items():
                yield SettingInForce(f"{top}.{key}{kind}", row, loaded.source(f"{top}.{key}{kind}"))


def _note_of_hold(config: Config) -> str:
    """The note on ``hold_limit``: without a limit a job silences the daemon, and the bus worker stops the robot."""
    dead_man = _dead_man(config)
    if not dead_man or config.hold_limit:
        return ""
    return f"a job that holds for longer than dead_man ({dead_man:g} s) stops the robot"


def _options_in_force(loaded: Loaded, table: type[SettingsTable]) -> Iterator[SettingInForce]:
    given = loaded.config.options
    _, in_url = split_parameters(loaded.config.url, table.in_url())
    made = table.of(from_texts(table.rules(), in_url, "parameter")[0] | given)
    for key in table.rules():
        source = f"options.{key}" if key in given else "url" if key in in_url else ""
        if key in table.secrets():
            yield SettingInForce(f"options.{key}", None, loaded.source(source), "secret, not shown")
        else:
            yield SettingInForce(f"options.{key}", getattr(made, key), loaded.source(source))


def read_toml(file: Path) -> dict[str, Any]:
    """The keys and values of a file.  Raises BadConfig if it cannot be read or is no TOML."""
    try:
        text = read_regular(file, MAX_FILE_BYTES).data.decode("utf-8")
    except FileNotFoundError as error:
        raise unreadable(file, error) from error
    except UnicodeDecodeError as error:
        raise BadConfig(f"{file}: is not UTF-8 text (byte {error.start})") from error
    _check_depth(text, file)
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # ValueError also for a number with thousands of digits
        raise BadConfig(f"{file}: is not TOML: {error}") from error


def _check_depth(text: str, file: Path) -> None:
    """Check the nesting depth before the text is parsed.  Raises BadConfig with the line."""
    depth = 0
    for match in _NESTING.finditer(text):
        depth += (match[1] is not None) - (match[2] is not None and depth > 0)
        if depth > MAX_DEPTH or match[3] is not None:
            line = text.count("\n", 0, match.start()) + 1
            raise BadConfig(f"{file}: nests more than {MAX_DEPTH} deep (line {line}): no setting does, "
                            "correct that line")


def _read(given: Mapping[str, Any], file: str) -> tuple[dict[str, Any], list[Complaint]]:
    """The settings of one source, converted by their rules, and the mistakes; ``file`` is empty for flags."""
    made, mistakes = Config.read(given, "setting")
    wrong = {each.key for each in mistakes}
    values = {key: getattr(made, key) for key in given if key not in wrong}
    return values, [Complaint(each.key, one_line(f"{_place(each.key, file)}: {each.text}")) for each in mistakes]


def _mistakes_about_robot(config: Config) -> Iterator[Mistake]:
    """The mistakes in settings that only the platform and the bus can check."""
    options = SettingsTable
    try:
        manifest = platforms.find(config.platform) if config.platform else None
        if manifest is not None:
            options = platforms.load_options(manifest)
    except BadConfig as error:
        yield Mistake("platform", str(error))
        return
    order = timeouts.mistake_in_order(config.hold_limit, _dead_man(config))
    if order is not None:
        yield order
    yield from platforms.mistakes(manifest, config.options, config.limits, config.devices)
    if manifest is None:
        for top in _TABLES:
            if getattr(config, top):
                yield Mistake(top, "cannot be checked without a platform; add platform = ..., or say --platform")
    if manifest is not None and config.fake and not manifest.fake:
        yield Mistake("fake", f"platform {manifest.name} has no simulated robot; give its url")
    hint = platforms.guess_url(manifest, config.url) if manifest is not None and config.url else ""
    if hint:
        yield Mistake("url", hint)
    elif config.url:
        yield from _mistakes_in_url(config.url, options)


def _mistakes_in_url(url: str, options: type[SettingsTable]) -> Iterator[Mistake]:
    try:
        port, own = split_parameters(url, options.in_url())
        values, mistakes = from_texts(options.rules(), own, "parameter")
        yield from (Mistake("url", str(each)) for each in mistakes or options.read(values, "parameter")[1])
        buses.port_for(port, Context())
    except (BadUrl, Unavailable) as error:
        yield Mistake("url", str(error))


def _place(key: str, file: str) -> str:
    return f"{file}: {key}" if file else "--" + key.replace("_", "-")
