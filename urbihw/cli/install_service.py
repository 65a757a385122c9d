"""Install a robot as a service of systemd: unit, drop-in, udev rules, user and settings.

Each robot of a machine is an instance of the same unit, ``urbihw@NAME.service``, with its settings in
``/etc/urbihw/NAME.toml`` and its own port.  Where the package of the distribution has brought the unit, only the files
of the robot are written.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Final

from urbihw import platforms
from urbihw.cli.options import DEFAULT_PORT, CliRefused, port
from urbihw.daemon.config import Config, configure, load
from urbihw.daemon.units import (
    NAME,
    PACKAGED_UNITS,
    SETTINGS,
    UNITS,
    ServiceFile,
    robot_files,
    rules_file,
    settings_file,
    settings_text,
    shared_files,
)
from urbihw.exitcodes import EX_CONFIG, EX_UNAVAILABLE
from urbihw.kernel.uobject import BadConfig
from urbihw.platforms import Manifest
from urbihw.started import as_typed

RUNNING: Final = Path("/run/systemd/system")
"""Exists where systemd manages the services."""
_APPLY: Final = (
    ("systemd-sysusers",),
    ("systemd-tmpfiles", "--create", "--prefix=/run/urbihw", "--prefix=/var/lib/urbihw", "--prefix=/etc/urbihw"),
    ("udevadm", "control", "--reload"),
    ("udevadm", "trigger"),
    ("systemctl", "daemon-reload"),
)
"""The commands by which the system takes the files up; none of them starts a robot."""
_PLAIN_PATH: Final = re.compile(r"/[\w/.+@-]*")
"""A path that has the same meaning in a unit of systemd: without blanks, quotes, %, $ and ends of lines."""
_HIDDEN: Final = ("/home", "/root", "/run/user")
"""The folders that ``ProtectHome`` of the unit hides."""


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw install-service``."""
    parser.add_argument("name", metavar="NAME", help="of the robot: urbihw@NAME.service, /etc/urbihw/NAME.toml")
    parser.add_argument("--platform", metavar="PLATFORM", help="which robot; without it the settings there are stay")
    parser.add_argument("--config", type=Path, metavar="FILE", help="a settings file to install instead of the sample")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--url", help="url of its bus (that of the platform)")
    where.add_argument("--fake", action="store_true", help="serve a simulated robot")
    parser.add_argument("--port", type=port, help=f"port to listen on (the first from {DEFAULT_PORT} that no other "
                                                  "robot of this machine has)")
    parser.add_argument("--root", type=Path, default=Path("/"), metavar="DIR",
                        help="write below DIR, and change nothing of the running system")
    parser.add_argument("--program", metavar="PATH", help="path of urbihw in the unit (that of this installation)")
    parser.add_argument("--dry-run", action="store_true", help="print the files instead of writing them")
    parser.add_argument("--uninstall", action="store_true", help="remove the robot's files; its settings stay")


def run(options: argparse.Namespace) -> int:
    """Install or remove the files; 78 if that is impossible, and then nothing is written."""
    try:
        if not NAME.fullmatch(options.name):
            raise CliRefused(f"{options.name!r} cannot be a name: take up to 32 letters, digits, _ and -", EX_CONFIG)
        if options.uninstall:
            _uninstall(options)
        else:
            _install(options)
    except (CliRefused, BadConfig) as error:
        print(f"urbihw install-service: {error}", file=sys.stderr)
        return error.code if isinstance(error, CliRefused) else EX_CONFIG
    except OSError as error:
        who = f"; as root: sudo {as_typed('urbihw install-service')} ..." if isinstance(error, PermissionError) else ""
        print(f"urbihw install-service: {error.filename}: {error.strerror}{who}", file=sys.stderr)
        return EX_CONFIG
    return 0


def _install(options: argparse.Namespace) -> None:
    files = list(_wanted_files(options))
    for file in files:
        if options.dry_run:
            print(f"# {file.path}\n{file.text}")
        else:
            _write(_below(options.root, file.path), file)
            print(file.path)
    if not options.dry_run:
        _apply(options.root)
        print(f"\nstart it, now and at boot: sudo systemctl enable --now urbihw@{options.name}")


def _wanted_files(options: argparse.Namespace) -> Iterator[ServiceFile]:
    """The files to write.  Raises CliRefused and BadConfig."""
    manifest, config, settings = _robot(options)
    if not _is_packaged(options.root):
        yield from shared_files(_command(options))
    yield from robot_files(options.name, manifest, config)
    if settings:
        yield ServiceFile(settings_file(options.name), settings, 0o640)


def _robot(options: argparse.Namespace) -> tuple[Manifest, Config, str]:
    """The platform and the settings of the robot, and the text of new settings; "" to leave those there are."""
    path = _below(options.root, settings_file(options.name))
    file = options.config or (path if options.platform is None and path.exists() else None)
    if file is not None and (options.platform or options.url or options.fake):
        raise CliRefused(f"platform, url and fake are those of {file}: change them there", EX_CONFIG)
    if path.exists() and file != path:
        raise CliRefused(
            f"{path} is there already and is not overwritten: edit it, or remove it; without --platform and "
            "--config only the other files are written anew",
            EX_CONFIG,
        )
    if file is not None:
        return _robot_of_file(options, file, installed=file == path)
    if options.platform is None:
        listing = as_typed("urbihw platforms")
        raise CliRefused(f"which robot? Give --platform NAME ({listing} lists them), or --config FILE", EX_CONFIG)
    manifest = platforms.find(options.platform)
    url = "" if options.fake else options.url or _default_url(manifest)
    if not url and not options.fake:
        raise CliRefused(f"where is the {manifest.name}? Give --url", EX_CONFIG)
    number = options.port or _free_port(options.root)
    _check_port(options, number)
    config = configure(None, {"platform": manifest.name, "url": url or None, "fake": options.fake, "port": number})
    return manifest, config, settings_text(manifest.name, url, number)


def _robot_of_file(options: argparse.Namespace, file: Path, *, installed: bool) -> tuple[Manifest, Config, str]:
    """The robot of a settings file; new settings that name no port get one."""
    config = configure(file)
    if not config.platform:
        raise CliRefused(f"{file}: platform is missing", EX_CONFIG)
    has_port = installed or "port" in load(file).in_file
    if options.port and has_port:
        raise CliRefused(f"the port is that of {file}: change it there", EX_CONFIG)
    number = config.port if has_port else options.port or _free_port(options.root)
    _check_port(options, number)
    text = "" if installed else file.read_text("utf-8")
    if number != config.port:
        # Keys of the whole file stand before the first table.
        text = f"port = {number}\n{text}"
    return platforms.find(config.platform), replace(config, port=number), text


def _default_url(manifest: Manifest) -> str:
    """The url of the platform; for a serial adapter that is known, the name that the udev rules give it."""
    if manifest.usb and manifest.default_url.startswith("/dev/"):
        return f"/dev/urbihw-{manifest.name}"
    return manifest.default_url


def _free_port(root: Path) -> int:
    """The first port from that of the manual that no settings of this machine name."""
    taken = set()
    for path in _below(root, SETTINGS).glob("*.toml"):
        try:
            taken.add(configure(path).port)
        except BadConfig as error:
            raise CliRefused(f"which ports are free? {error}; correct it, or give --port", EX_CONFIG) from error
    return next(number for number in range(DEFAULT_PORT, 65536) if number not in taken)


def _check_port(options: argparse.Namespace, number: int) -> None:
    """Raise CliRefused if another robot of this machine has the port; settings that cannot be read name none."""
    own = _below(options.root, settings_file(options.name))
    for path in sorted(_below(options.root, SETTINGS).glob("*.toml")):
        try:
            taken = path != own and configure(path).port == number
        except BadConfig:
            continue
        if taken and number:
            raise CliRefused(f"port {number} is that of {path}: choose another one", EX_CONFIG)


def _is_packaged(root: Path) -> bool:
    """Whether a package of the distribution has brought the unit."""
    return any(_below(root, folder / "urbihw@.service").exists() for folder in PACKAGED_UNITS)


def _command(options: argparse.Namespace) -> str:
    """The path of urbihw for the unit.  Raises CliRefused if the user of the service could not run it."""
    if options.program:
        if not _PLAIN_PATH.fullmatch(options.program):
            raise CliRefused(f"--program {options.program!r}: for a unit write a full path of letters, digits and "
                             "/ . _ + @ - only", EX_CONFIG)
        return str(options.program)
    command = Path(sys.executable).with_name("urbihw")
    if not command.exists():
        raise CliRefused(f"there is no {command}; name urbihw by its path: --program PATH", EX_CONFIG)
    if options.root == Path("/"):
        for path in (command, command.resolve(), Path(sys.executable).resolve()):
            if _is_hidden(path):
                raise CliRefused(f"the user of the service cannot run {path}: install urbihw outside of home folders "
                                 "first, such as in /opt/urbihw (docs/operations.md)", EX_CONFIG)
    return str(command)


def _is_hidden(path: Path) -> bool:
    if any(path.is_relative_to(folder) for folder in _HIDDEN):
        return True
    return not all(folder.stat().st_mode & 0o001 for folder in (path, *path.parents))


def _below(root: Path, path: PurePosixPath) -> Path:
    return root / path.relative_to("/")


def _write(path: Path, file: ServiceFile) -> None:
    path.parent.mkdir(mode=0o755, parents=True, exist_ok=True)
    with open(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, file.mode), "w", encoding="utf-8") as opened:
        os.fchmod(opened.fileno(), file.mode)
        opened.write(file.text)


def _apply(root: Path) -> None:
    """Make the running system take the files up.  Raises CliRefused."""
    if root != Path("/"):
        return
    if not RUNNING.is_dir():
        print(f"\nsystemd does not run here; where it does: {'; '.join(' '.join(words) for words in _APPLY)}")
        return
    for words in _APPLY:
        _call(words)


def _call(words: Sequence[str]) -> None:
    try:
        done = subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace",
                              check=False)
    except OSError as error:
        raise CliRefused(f"{words[0]}: {error.strerror}", EX_UNAVAILABLE) from error
    if done.returncode:
        raise CliRefused(f"{' '.join(words)}: {' '.join(done.stderr.split())[-300:]}", EX_UNAVAILABLE)


def _uninstall(options: argparse.Namespace) -> None:
    """Remove the drop-ins of the robot, and what is for all robots with the last one."""
    units = _below(options.root, UNITS)
    others = [path for path in units.glob("urbihw@?*.service.d") if path.name != f"urbihw@{options.name}.service.d"]
    targets = [units / f"urbihw@{options.name}.{kind}.d" / file
               for kind, file in (("service", "50-platform.conf"), ("socket", "50-port.conf"))]
    targets.append(_below(options.root, rules_file(options.name)))
    if not any(path.exists() for path in targets):
        raise CliRefused(f"there is no service of a robot {options.name}", EX_CONFIG)
    if not others:
        targets += [_below(options.root, file.path) for file in shared_files("")]
    if options.root == Path("/") and RUNNING.is_dir() and not options.dry_run:
        for kind in ("socket", "service"):
            _call(("systemctl", "disable", "--now", f"urbihw@{options.name}.{kind}"))
    for path in filter(Path.exists, targets):
        print(path)
        if not options.dry_run:
            path.unlink()
            if path.parent.suffix == ".d" and path.parent.parent == units and not any(path.parent.iterdir()):
                path.parent.rmdir()
    if options.root == Path("/") and RUNNING.is_dir() and not options.dry_run:
        _call(("systemctl", "daemon-reload"))
    settings = _below(options.root, settings_file(options.name))
    if settings.exists():
        print(f"\nthe settings stay: {settings}")
