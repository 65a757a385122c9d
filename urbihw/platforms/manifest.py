"""``platform.toml`` as a dataclass, checked with messages for the author of the file.

A manifest is read without importing the platform's code, so that a list of the platforms is fast, and a broken one
spoils only its own row.  The same holds for platforms of other packages.
"""

from __future__ import annotations

import importlib.util
import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import field, fields
from pathlib import Path
from typing import Any, Final, NamedTuple

from urbihw.frozen import frozen
from urbihw.kernel.uobject import BadConfig
from urbihw.platforms.limits import DeviceLimits

FILE: Final = "platform.toml"
KINDS: Final = tuple(DeviceLimits.rules())


class BadManifest(BadConfig):
    """An invalid manifest; the message names the file, the key and the expected value."""


class PlatformFolder(NamedTuple):
    """Where a platform is.

    Attributes:
        name: of the platform.
        path: the folder with the manifest.
        package: the full name of the Python package in that folder.
        wheel: the name of the distribution that has it; "" for urbihw itself.
        problem: why its manifest cannot be read; "" if that can be tried.
    """

    name: str
    path: Path
    package: str
    wheel: str = ""
    problem: str = ""


OWN_FOLDER: Final = Path(__file__).resolve().parents[1]
"""The folder of this package.  If Python runs in a folder with an entry of that name, such as that of a robot's state,
`find_spec` finds that one where this package is installed in place."""


def package_folder(package: str) -> Path | None:
    """The folder of a package, without importing it; None if there is none."""
    top, *inner = package.split(".")
    places: Iterable[str | Path] = (OWN_FOLDER,)
    if top != OWN_FOLDER.name:
        spec = importlib.util.find_spec(top)
        places = () if spec is None else spec.submodule_search_locations or ()
    return next((folder for folder in (Path(place, *inner) for place in places) if folder.is_dir()), None)


@frozen(slots=False)
class UsbId:
    """An adapter or robot by its USB numbers."""

    vendor: int
    product: int
    name: str


@frozen(slots=False)
class SystemNeeds:
    """What the daemon needs of the operating system to reach the robot; the service admits that and nothing else.

    Attributes:
        devices: device nodes, as systemd's ``DeviceAllow`` names them: ``char-ttyUSB`` (a name of ``/proc/devices``) or
            a path such as ``/dev/i2c-1``.
        address_families: kinds of sockets besides UNIX and the Internet, such as ``AF_CAN``.
        groups: groups that own these devices.
    """

    devices: tuple[str, ...] = ()
    address_families: tuple[str, ...] = ()
    groups: tuple[str, ...] = ()


@frozen(slots=False)
class Manifest:
    """The description of a platform.

    Attributes:
        folder: of the platform.
        package: the full name of the Python package in the folder.
        wheel: the name of the distribution that has it; "" for urbihw itself.
        name: of the platform, and of its folder or, in another package, of its entry point.
        title: one line for people.
        robot: "module:Class" inside the folder; the class derives from ``urbihw.kernel.uobject.PlatformRobot``.
        slot: the slot of Global that holds the robot.
        library: urbiscript files, loaded in this order before the robot is opened: files of the folder, or
            "package:file" for one that several platforms load.
        buses: its families of wire protocols.
        default_url: url of the bus if the user gives none; "" for none.
        usb: its adapters, for the detection of the platform.
        fake: arguments of ``python -m urbihw_fakes`` for the same robot, simulated; () for none.
        needs: extras of urbihw, or of the wheel, that must be installed.
        options: "module:Class" of the table of its ``[options]``, a ``urbihw.settings.SettingsTable``; a module of
            the folder, or one of ``urbihw.buses`` by its full name; "" for no options.
        scan: "module:function" of the folder, which searches the network for robots and yields a line for each;
            "" for no search.
        trace: "module:function" of the folder, or of ``urbihw.buses`` by its full name, which makes the decoder of its
            traffic (``urbihw.buses.trace.MakeDecoder``); "" for none.
        on_robot: a file of the folder: the program that runs on the robot itself, as ``urbihw platforms --on-robot``
            prints it; "" for none.
        devices: whether the settings may name the expected devices (``[devices]``): a chain of servos.
        system: what it needs of the operating system.
        leads_time: whether the robot is a simulation whose time is that of the programs.
        dead_man: the longest time in s for which the robot may be without a sign of life of the daemon, whatever the
            settings say; 0 leaves it to them.
        limits: the devices that can have ``[limits]`` -> their kinds of limits; ``#`` in a name stands for a number,
            and the name ``*`` for any.
        joints: names of joints -> the ids of their devices, where the platform names them.
        joint_model: the model of the servos of these joints, "" for any.
    """

    folder: Path
    package: str
    wheel: str
    name: str
    title: str
    robot: str
    slot: str
    library: tuple[str, ...] = ()
    buses: tuple[str, ...] = ()
    default_url: str = ""
    usb: tuple[UsbId, ...] = ()
    fake: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()
    options: str = ""
    scan: str = ""
    trace: str = ""
    on_robot: str = ""
    devices: bool = False
    leads_time: bool = False
    dead_man: float = 0.0
    system: SystemNeeds = SystemNeeds()
    limits: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    joints: Mapping[str, int] = field(default_factory=dict)
    joint_model: str = ""

    def library_files(self) -> list[Path]:
        """The paths of its urbiscript files, in the order of loading."""
        return [_library_file(self.folder, name) for name in self.library]


_TEXTS: Final = {
    "name", "title", "robot", "slot", "default_url", "options", "scan", "trace", "on_robot", "joint_model",
}  # fmt: skip
_LISTS: Final = {"library", "buses", "fake", "needs"}
_REQUIRED: Final = ("name", "title", "robot", "slot")
_NAME: Final = re.compile(r"[a-z][a-z0-9_]{0,31}")
"""The form of names, which become parts of files, units and udev rules."""
_SYSTEM: Final = {
    "devices": re.compile(r"(?:char|block)-[\w.*-]+|/dev/[\w./-]+"),
    "address_families": re.compile(r"AF_[A-Z0-9]+"),
    "groups": re.compile(r"[a-z_][a-z0-9_-]{0,31}"),
}
"""Key of ``[system]`` -> the form of its texts, which become lines of a unit of systemd."""


def read(folder: PlatformFolder) -> Manifest:
    """Return the manifest of the platform in ``folder``.  Raises BadManifest."""
    if folder.problem:
        raise BadManifest(folder.problem)
    path = folder.path / FILE
    try:
        table = tomllib.loads(path.read_text("utf-8"))
    except OSError as error:
        raise BadManifest(f"{path}: cannot be read: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise BadManifest(f"{path}: is no TOML: {error}") from error
    try:
        return Manifest(folder=folder.path, package=folder.package, wheel=folder.wheel, **_checked(table, folder))
    except BadManifest as error:
        raise BadManifest(f"{path}: {error}") from None


def _checked(table: Mapping[str, Any], place: PlatformFolder) -> dict[str, Any]:
    known = {each.name for each in fields(Manifest)} - {"folder", "package", "wheel"}
    folder = place.path
    for key in table:
        if key not in known:
            raise BadManifest(f"{key!r} is no key of a manifest; known: {', '.join(sorted(known))}")
    for key in _REQUIRED:
        if key not in table:
            raise BadManifest(f"{key!r} is missing")
    values = {key: _value(key, value) for key, value in table.items()}
    if not _NAME.fullmatch(values["name"]):
        raise BadManifest(f"name must be of small letters, digits and _, not {values['name']!r}")
    if values["name"] != place.name:
        other = "entry point" if place.wheel else "folder"
        raise BadManifest(f"name is {values['name']!r}, but the {other} is called {place.name!r}; make them the same")
    module, colon, kind = values["robot"].partition(":")
    if not (colon and module.isidentifier() and kind.isidentifier()):
        raise BadManifest(f"robot must be written module:Class, not {values['robot']!r}")
    if not (folder / f"{module}.py").is_file():
        raise BadManifest(f"robot names the module {module!r}, but there is no {module}.py beside the manifest")
    if not values["slot"].isidentifier():
        raise BadManifest(f"slot must be a name as urbiscript takes it, not {values['slot']!r}")
    for key, files in (("library", values.get("library", ())), ("on_robot", [values.get("on_robot")])):
        for file in files:
            if file and not _library_file(folder, file).is_file():
                raise BadManifest(f"{key} names {file!r}, which is not beside the manifest")
    return values


def _library_file(folder: Path, name: str) -> Path:
    """The path of a file of the folder, or of another package: "package:file"."""
    package, colon, file = name.rpartition(":")
    return (package_folder(package) or folder if colon else folder) / file


def _value(key: str, value: Any) -> Any:
    if key in _TEXTS:
        if not isinstance(value, str):
            raise BadManifest(f"{key} must be a text in quotes, not {value!r}")
        return value
    if key in _LISTS:
        if not isinstance(value, list) or not all(isinstance(member, str) for member in value):
            raise BadManifest(f'{key} must be a list of texts, such as ["a", "b"], not {value!r}')
        return tuple(value)
    if key in ("devices", "leads_time"):
        if not isinstance(value, bool):
            raise BadManifest(f"{key} must be true or false, not {value!r}")
        return value
    if key == "dead_man":
        if isinstance(value, bool) or not isinstance(value, int | float) or not value > 0:
            raise BadManifest(f"dead_man must be a number of seconds above 0, not {value!r}")
        return float(value)
    if key == "system":
        return _system(value)
    if key == "limits":
        return _limits(value)
    if key == "joints":
        if not isinstance(value, dict) or not all(isinstance(number, int) for number in value.values()):
            raise BadManifest(f"joints must be a table such as elbow = 3, not {value!r}")
        return value
    return tuple(_usb(row) for row in value) if isinstance(value, list) else _usb(value)


def _limits(table: Any) -> dict[str, tuple[str, ...]]:
    if not isinstance(table, dict) or not all(isinstance(kinds, list) for kinds in table.values()):
        raise BadManifest('limits must be a table such as "motor#" = ["speed", "torque"]')
    for device, kinds in table.items():
        for kind in kinds:
            if kind not in KINDS:
                raise BadManifest(f"limits.{device}: no such limit: {kind!r}; there are: {', '.join(KINDS)}")
    return {device: tuple(kinds) for device, kinds in table.items()}


def _system(table: Any) -> SystemNeeds:
    if not isinstance(table, dict) or not set(table) <= _SYSTEM.keys():
        raise BadManifest(f"system must be a table with the keys {', '.join(_SYSTEM)}")
    for key, texts in table.items():
        form = _SYSTEM[key]
        if not isinstance(texts, list) or not all(isinstance(one, str) and form.fullmatch(one) for one in texts):
            raise BadManifest(f"system.{key} must be a list of texts of the form {form.pattern}, not {texts!r}")
    return SystemNeeds(**{key: tuple(texts) for key, texts in table.items()})


def _usb(row: Any) -> UsbId:
    if not isinstance(row, dict) or set(row) != {"vendor", "product", "name"}:
        raise BadManifest('usb must be a list of { vendor = 0x0403, product = 0x6001, name = "..." }')
    for key in ("vendor", "product"):
        if not isinstance(row[key], int) or not 0 <= row[key] <= 0xFFFF:
            raise BadManifest(f"usb: {key} must be a number from 0 to 0xffff, not {row[key]!r}")
    return UsbId(row["vendor"], row["product"], str(row["name"]))
