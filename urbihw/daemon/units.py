"""The files of the service: their paths, and the texts that depend on the robot.

``urbihw/share`` has the parts that are the same for all robots, and the sample of the settings.  A robot adds a drop-in
to its instance of the unit, made from the table ``[system]`` of its platform, and its settings.
"""

from __future__ import annotations

import json
import re
from pathlib import Path, PurePosixPath
from typing import Final

from urbihw.daemon.config import Config
from urbihw.frozen import frozen
from urbihw.platforms import Manifest

SHARE: Final = Path(__file__).parents[1] / "share"
"""The folder of the files that are the same for all robots."""
PACKAGED_COMMAND: Final = "/usr/bin/urbihw"
"""The command in the unit of ``share``, which is that of a package of the distribution."""
SETTINGS: Final = PurePosixPath("/etc/urbihw")
UNITS: Final = PurePosixPath("/etc/systemd/system")
PACKAGED_UNITS: Final = (PurePosixPath("/usr/lib/systemd/system"), PurePosixPath("/lib/systemd/system"))
"""Where a package of the distribution has its units."""
NAME: Final = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_-]{0,31}")
"""The form of the name of a robot: a part of the names of units and files."""

_SHARED: Final = {
    "urbihw@.service": UNITS / "urbihw@.service",
    "urbihw@.socket": UNITS / "urbihw@.socket",
    "99-urbihw.rules": PurePosixPath("/etc/udev/rules.d/99-urbihw.rules"),
    "urbihw.sysusers": PurePosixPath("/etc/sysusers.d/urbihw.conf"),
    "urbihw.tmpfiles": PurePosixPath("/etc/tmpfiles.d/urbihw.conf"),
}
"""File of ``share`` -> where it is installed, once for all robots."""


@frozen(slots=False)
class ServiceFile:
    """A file to install: its path on the machine, its text and its permissions."""

    path: PurePosixPath
    text: str
    mode: int = 0o644


def shared_files(command: str) -> list[ServiceFile]:
    """The files for all robots; ``command`` is the path of ``urbihw``."""
    return [
        ServiceFile(path, (SHARE / name).read_text("utf-8").replace(PACKAGED_COMMAND, command))
        for name, path in _SHARED.items()
    ]


def robot_files(name: str, manifest: Manifest, config: Config) -> list[ServiceFile]:
    """The files of one robot: drop-ins with what its platform needs and with the address of its port, and the udev
    rules of a platform of another package.
    """
    rules = [ServiceFile(rules_file(name), udev_rules(manifest))] if manifest.wheel and manifest.usb else []
    return [
        *rules,
        ServiceFile(UNITS / f"urbihw@{name}.service.d" / "50-platform.conf", drop_in(manifest)),
        ServiceFile(UNITS / f"urbihw@{name}.socket.d" / "50-port.conf",
                    "# The address of the settings: host and port.\n\n[Socket]\n"
                    f"ListenStream={_stream(config.host, config.port)}\n"),
    ]


def drop_in(manifest: Manifest) -> str:
    """The drop-in that admits what a platform declares."""
    needs = manifest.system
    rows = [f"# What the platform {manifest.name} needs of the operating system.", "", "[Service]"]
    rows += [f"DeviceAllow={device} rw" for device in needs.devices]
    rows += [f"RestrictAddressFamilies={family}" for family in needs.address_families]
    rows += [f"SupplementaryGroups={group}" for group in needs.groups]
    return "\n".join(rows) + "\n"


def rules_file(name: str) -> PurePosixPath:
    """The path of the udev rules of a robot whose platform is of another package."""
    return PurePosixPath(f"/etc/udev/rules.d/99-urbihw@{name}.rules")


def udev_rules(manifest: Manifest) -> str:
    """The udev rules for the adapters of a platform; those of the platforms of urbihw are a file of ``share``."""
    is_serial = manifest.default_url.startswith("/dev/")
    kind = 'SUBSYSTEM=="tty"' if is_serial else 'SUBSYSTEM=="usb", ENV{DEVTYPE}=="usb_device"'
    rows = [f"# The adapters of the platform {manifest.name}, of the package {manifest.wheel}.", ""]
    rows += [
        f'ACTION!="remove", {kind}, ATTRS{{idVendor}}=="{usb.vendor:04x}", ATTRS{{idProduct}}=="{usb.product:04x}", '
        f'SYMLINK+="urbihw-{manifest.name}", GROUP="dialout", MODE="0660"'
        for usb in manifest.usb
    ]
    return "\n".join(rows) + "\n"


def settings_file(name: str) -> PurePosixPath:
    """The path of the settings of a robot."""
    return SETTINGS / f"{name}.toml"


def settings_text(platform: str, url: str, port: int) -> str:
    """The sample of the settings with robot, url (printable; "": a simulated robot) and port."""
    rows = {
        "platform": f'platform = "{platform}"',
        "url": f"url = {json.dumps(url, ensure_ascii=False)}" if url else '#url = ""',
        "#fake": "#fake = false" if url else "fake = true",
        "#port": f"port = {port}",
    }
    lines = (SHARE / "urbihw.toml").read_text("utf-8").splitlines()
    return "".join(f"{rows.get(line.partition(' = ')[0], line)}\n" for line in lines)


def _stream(host: str, port: int) -> str:
    """An address as ``ListenStream`` of systemd takes it: a number, not a name; % begins a specifier there."""
    address = "127.0.0.1" if host == "localhost" else host.replace("%", "%%")
    return f"[{address}]:{port}" if ":" in address else f"{address}:{port}"
