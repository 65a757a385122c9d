"""The robots: one folder each, found by its manifest, loaded only when it is asked for.

A robot may be a package of its own, too, found by its entry point of the group ``urbihw.platforms``.

Where to start: ``manifest`` (what a platform says of itself), ``hooks`` (what a platform implements), ``base`` (what
every robot on one wire does with its worker), with ``guarded`` (stops), ``limited`` (limits), ``arrival`` (a
robot that is absent at the start) and ``channel`` (how devices reach the worker), then ``bioloid`` (the first, and the
example). A platform imports those, ``urbihw.kernel.uobject``, ``urbihw.buses`` and ``urbihw.navigation``, never another
platform.

Beside them: ``session`` (with the worker), ``drawn`` (the figure), ``measured`` and ``streamed`` (devices whose values
come), ``clipping`` (limits as a device shows them), ``identity``, ``problems`` and ``devicelog`` (what a robot tells),
``expected``, ``taken`` and ``remembered`` (``[devices]``, their names, those of the last run), ``camera`` with ``film``
and ``jpeg``, ``speaker`` with ``sound``.

In the folder of a robot ``options`` are its ``[options]``, ``words`` the meanings of its slots (those of several robots
in ``words`` here), ``trace`` decodes its traffic. Three folders are no robots: ``servos`` (what robots on a servo bus
share), ``teach`` (recorded motions), ``scene`` (looking at simulated worlds). The robots: ``bioloid``, ``chain``,
``cia402``, ``nxt``, ``p3dx``, ``segway``, ``so101``, ``spykee``, ``webots``.
"""

from __future__ import annotations

import importlib
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any, Final, NamedTuple

from urbihw.buses import port_for, ports
from urbihw.buses.errors import BadUrl, Unavailable
from urbihw.buses.link import Context
from urbihw.buses.servos.tables import model_names
from urbihw.buses.tcp import TcpLink
from urbihw.buses.trace import MakeDecoder
from urbihw.extras import install_command
from urbihw.kernel.uobject import BadConfig, PlatformRobot
from urbihw.platforms import expected, limits
from urbihw.platforms.expected import DeviceSettings
from urbihw.platforms.limits import DeviceLimits
from urbihw.platforms.manifest import FILE, BadManifest, Manifest, PlatformFolder, package_folder, read
from urbihw.settings import Mistake, SettingsTable, guess

__all__ = [
    "Adapter", "BadManifest", "DeviceLimits", "DeviceSettings", "Manifest", "PlatformFolder", "adapters", "find",
    "folders", "load", "load_options", "load_trace", "manifests", "mistakes", "owner", "read", "scan", "wheels",
]  # fmt: skip


ENTRY_POINTS: Final = "urbihw.platforms"
"""Group under which other packages name their platforms: name = platform, value = the package with its manifest."""


def folders(root: Path | None = None) -> list[PlatformFolder]:
    """All platforms, in order of their names: those of this package, or of ``root``, and those of other packages."""
    own = _own_folders(root)
    return sorted((own | (_outside_folders(own) if root is None else {})).values())


def _own_folders(root: Path | None) -> dict[str, PlatformFolder]:
    here = Path(__file__).parent if root is None else root
    found = (path.parent for path in here.glob(f"*/{FILE}"))
    return {folder.name: PlatformFolder(folder.name, folder, f"{__name__}.{folder.name}") for folder in found}


def _outside_folders(own: Mapping[str, PlatformFolder]) -> dict[str, PlatformFolder]:
    """The platforms of other packages, found by their entry points; none of their code is imported."""
    # Imported here because it costs 15 ms, and most robots are of this package.
    from importlib.metadata import entry_points

    found: dict[str, PlatformFolder] = {}
    for entry in entry_points(group=ENTRY_POINTS):
        wheel = entry.dist.name if entry.dist is not None else entry.value
        path, name, problem = package_folder(entry.value), entry.name, ""
        if path is None:
            problem = f"platform {name} of {wheel}: there is no package {entry.value}"
        elif name in own or name in found:
            other = "urbihw" if name in own else found[name].wheel
            name, problem = f"{name} of {wheel}", f"platform {name} of {wheel}: {other} has a platform of this name"
        found[name] = PlatformFolder(name, path or Path(), entry.value, wheel, problem)
    return found


def manifests() -> Iterator[Manifest]:
    """The manifests of all platforms, without the broken ones: ``urbihw platforms`` tells what is wrong with them."""
    for folder in folders():
        try:
            yield read(folder)
        except BadManifest:
            continue


def wheels() -> dict[str, str]:
    """The platforms that are known to be packages of their own -> these packages, whether or not they are installed."""
    return tomllib.loads(Path(__file__).with_name("wheels.toml").read_text("utf-8"))


def owner(name: str) -> str:
    """What has a platform of this name: "urbihw", or a package of its own, even one not installed; "" if none has."""
    taken = wheels() | {folder.name: folder.wheel or "urbihw" for folder in folders()}
    return taken.get(name, "")


def find(name: str, root: Path | None = None) -> Manifest:
    """The manifest of a platform by name.  Raises BadConfig, naming those there are, and BadManifest."""
    own = _own_folders(root)
    known = own if name in own else {folder.name: folder for folder in folders(root)}
    wheel = "" if name in known else wheels().get(name, "")
    if wheel:
        raise BadConfig(f"platform {name} is a package of its own: install {wheel} (docs/operations.md)")
    if name not in known:
        raise BadConfig(f"no platform {name!r}{guess(name, known)}")
    return read(known[name])


def guess_url(manifest: Manifest, url: str) -> str:
    """The question whether a url without a scheme was meant for the TCP bus of a platform; "" for no question."""
    scheme, colon, _ = manifest.default_url.partition("://")
    if not colon or "://" in url or url.startswith("/") or Path(url).exists():
        return ""
    meant = f"{scheme}://{url}"
    try:
        port = port_for(meant, Context())
    except (BadUrl, Unavailable):
        return ""
    return f"bus url {url!r}: did you mean {meant}?" if isinstance(port, TcpLink) else ""


class Adapter(NamedTuple):
    """A serial port whose USB adapter a manifest names."""

    url: str
    name: str


def adapters(manifest: Manifest) -> list[Adapter]:
    """The serial ports of this machine that may carry a platform, by the USB ids of its manifest."""
    if not manifest.default_url.startswith("/"):
        return []
    names = {(each.vendor, each.product): each.name for each in manifest.usb}
    return [
        Adapter(port.device, " ".join(filter(None, (names[ids], port.serial_number))))
        for port in ports.serial_ports()
        for ids in [(port.vendor or 0, port.product or 0)]
        if ids in names
    ]


def load(manifest: Manifest) -> type[PlatformRobot]:
    """Import a platform: the class of its robot.

    Raises BadConfig when a package is missing that it needs, BadManifest when the class is not there.
    """
    module_name, _, class_name = manifest.robot.partition(":")
    try:
        module = _module(manifest, module_name)
    except ImportError as error:
        raise _missing(manifest, error) from error
    found = getattr(module, class_name, None)
    if not (isinstance(found, type) and issubclass(found, PlatformRobot)):
        raise BadManifest(f"{manifest.folder / FILE}: {module_name}.py has no class {class_name} that is a Robot")
    return found


def _module(manifest: Manifest, name: str) -> ModuleType:
    """Import a module of a platform, or one by its full name.

    Raises ImportError, and BadManifest where the code of another package fails: it names the platform.
    """
    full = name if "." in name else f"{manifest.package}.{name}"
    try:
        return importlib.import_module(full)
    except Exception as error:
        foreign = isinstance(error, ModuleNotFoundError) and not f"{error.name}.".startswith(
            (f"{manifest.package}.", "urbihw.")
        )
        if foreign or not manifest.wheel:
            raise
        why = f"{type(error).__name__}: {' '.join(str(error).split())}"
        raise BadManifest(f"platform {manifest.name} of {manifest.wheel} cannot be imported: {why}") from error


def _missing(manifest: Manifest, error: ImportError) -> BadConfig:
    """The error of a platform whose import has failed for want of a package: how that is installed."""
    wheel = manifest.wheel or "urbihw"
    how = install_command(*manifest.needs, wheel=wheel) if manifest.needs else f"pip install {error.name}"
    return BadConfig(f"platform {manifest.name} needs the Python package {error.name}: {how}")


def load_options(manifest: Manifest) -> type[SettingsTable]:
    """Import the table of a platform's options, without its robot.  Raises BadManifest when it is not there."""
    if not manifest.options:
        return SettingsTable
    module_name, _, class_name = manifest.options.partition(":")
    try:
        found = getattr(_module(manifest, module_name), class_name, None)
    except ImportError as error:
        raise BadManifest(f"{manifest.folder / FILE}: options: {error}") from error
    if not (isinstance(found, type) and issubclass(found, SettingsTable)):
        raise BadManifest(f"{manifest.folder / FILE}: options: {module_name} has no class {class_name} that is a Table")
    return found


def scan(manifest: Manifest) -> Iterable[object]:
    """Look for robots of a platform on the network: each as a line that begins with its url, as it is found.

    Raises BadConfig when they cannot be looked for; iterating raises OSError when there is no network.
    """
    if not manifest.scan:
        raise BadConfig(f"a {manifest.name} cannot be looked for on the network; name its port: --url")
    module_name, _, function = manifest.scan.partition(":")
    try:
        found = getattr(_module(manifest, module_name), function)
    except (ImportError, AttributeError) as error:
        raise BadManifest(f"{manifest.folder / FILE}: scan: {error}") from error
    robots: Iterable[object] = found()
    return robots


def load_trace(manifest: Manifest) -> MakeDecoder:
    """Import what makes the decoder of a platform's traffic.

    Raises BadConfig when there is none, or a package is missing that it needs; BadManifest when it is not there.
    """
    if not manifest.trace:
        raise BadConfig(f"the traffic of a {manifest.name} cannot be decoded")
    module_name, _, function = manifest.trace.partition(":")
    try:
        found: MakeDecoder = getattr(_module(manifest, module_name), function)
    except ModuleNotFoundError as error:
        if manifest.needs and not str(error.name).startswith("urbihw"):
            raise _missing(manifest, error) from error
        raise BadManifest(f"{manifest.folder / FILE}: trace: {error}") from error
    except AttributeError as error:
        raise BadManifest(f"{manifest.folder / FILE}: trace: {error}") from error
    return found


def _joints(manifest: Manifest, devices: Mapping[str, Any]) -> dict[str, str]:
    """The names of joints -> the slots of their servos."""
    named = expected.ids(devices) if devices else manifest.joints
    return {name: f"motor{number}" for name, number in named.items()}


def mistakes(
    manifest: Manifest | None, options: Mapping[str, Any], limits_: Mapping[str, Any], devices: Mapping[str, Any]
) -> Iterator[Mistake]:
    """What is wrong with the tables ``[options]``, ``[limits]`` and ``[devices]`` for a platform; None if it is not
    known which.

    Raises BadManifest.
    """
    if manifest is not None:
        for mistake in load_options(manifest).read(options, f"option of {manifest.name}")[1]:
            yield Mistake(f"options.{mistake.key}", mistake.text)
    kinds = None if manifest is None else manifest.limits
    for mistake in limits.mistakes(limits_, kinds, {} if manifest is None else _joints(manifest, devices)):
        yield Mistake(f"limits.{mistake.key}", mistake.text)
    if devices and manifest is not None and not manifest.devices:
        yield Mistake("devices", f"platform {manifest.name} finds its parts by itself; only chains of servos have it")
    elif devices:
        taken = () if manifest is None else (manifest.slot,)
        for mistake in expected.mistakes(devices, model_names(), taken):
            yield Mistake(f"devices.{mistake.key}", mistake.text)
