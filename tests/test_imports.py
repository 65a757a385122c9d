"""Who may import whom: the table of the design, enforced on every file, with no exception list.

Changing a rule means changing ``MAY_IMPORT`` here, on purpose.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]

ROOTS = (
    (".", "urbihw"), ("fakes", "urbihw_fakes"), ("packages/nao", "urbihw_nao"), ("packages/nao", "urbihw_nao_fakes"),
    ("packages/lerobot", "lerobot_robot_urbihw"),
)  # fmt: skip
"""Folder and package of all sources of the product."""

ROBOT = "urbihw.platforms.*"
"""Stands for the package of one robot; each is an area of its own."""

EVERYWHERE = ("urbihw.frozen",)
"""What all of the product may use as if it were Python's own library; the simulated robots share nothing with it."""

SIMULATED = ("urbihw_fakes", "urbihw_nao_fakes")

MAY_IMPORT: dict[str, tuple[str, ...]] = {
    "urbihw.frozen": (),
    # The kernel.  Its packages also see kernel.errors and kernel.value, and nothing of their own package is ever
    # forbidden.
    "urbihw.kernel.errors": (),
    "urbihw.kernel.recursion": (),
    "urbihw.kernel.value": (),
    "urbihw.kernel.syntax": ("urbihw.kernel.errors",),
    "urbihw.kernel.sched": ("urbihw.kernel.errors", "urbihw.kernel.recursion"),
    "urbihw.kernel.compiler": (
        "urbihw.kernel.errors",
        "urbihw.kernel.recursion",
        "urbihw.kernel.value",
        "urbihw.kernel.syntax",
    ),
    "urbihw.kernel.runtime": ("urbihw.kernel.errors", "urbihw.kernel.value", "urbihw.kernel.sched"),
    "urbihw.kernel.uobject": (
        "urbihw.kernel.errors",
        "urbihw.kernel.value",
        "urbihw.kernel.runtime",
        "urbihw.kernel.sched",
    ),
    "urbihw.kernel.uremote": (
        "urbihw.client.lines",
        "urbihw.client.values",
        "urbihw.kernel.errors",
        "urbihw.kernel.value",
        "urbihw.kernel.runtime",
        "urbihw.kernel.sched",
        "urbihw.kernel.uobject",
    ),
    "urbihw.kernel.stdlib": (
        "urbihw.release",
        "urbihw.kernel.errors",
        "urbihw.kernel.value",
        "urbihw.kernel.compiler",
        "urbihw.kernel.runtime",
        "urbihw.kernel.sched",
    ),
    "urbihw.kernel.lobby": (
        "urbihw.kernel.errors",
        "urbihw.kernel.value",
        "urbihw.kernel.compiler",
        "urbihw.kernel.syntax",
        "urbihw.kernel.runtime",
        "urbihw.kernel.sched",
    ),
    "urbihw.kernel.server": (
        "urbihw.kernel.errors",
        "urbihw.kernel.lobby",
        "urbihw.kernel.recursion",
        "urbihw.kernel.sched",
        "urbihw.repeats",
    ),
    "urbihw.kernel.boot": ("urbihw.kernel",),
    # The door for libraries beside the standard one.
    "urbihw.kernel.library": (
        "urbihw.kernel.errors",
        "urbihw.kernel.value",
        "urbihw.kernel.runtime",
        "urbihw.kernel.sched",
        "urbihw.kernel.stdlib",
    ),
    "urbihw.kernel.facade": (
        "urbihw.kernel.errors",
        "urbihw.kernel.boot",
        "urbihw.kernel.lobby",
        "urbihw.kernel.sched",
        "urbihw.kernel.stdlib",
        "urbihw.kernel.uobject",
    ),
    "urbihw.kernel.stages": ("urbihw.kernel.errors", "urbihw.kernel.compiler", "urbihw.kernel.syntax"),
    "urbihw.kernel": ("urbihw.kernel.facade",),
    # The process around a kernel: what a daemon, a console and a remote have in common.
    "urbihw.kernel.process": ("urbihw.kernel.facade", "urbihw.kernel.server"),
    # What all robots have in common in urbiscript.
    "urbihw.robot": ("urbihw.kernel.library", "urbihw.figure"),
    # Links, joints and shapes of a robot: a table, and what is calculated from it.
    "urbihw.figure": (),
    # What a setting may be: of the daemon, of a platform, of a bus url.
    "urbihw.settings": (),
    # Files that a user names.
    "urbihw.files": (),
    # Pauses between tries, counting of what repeats, exit codes of the commands: for all that need them.
    "urbihw.backoff": (),
    "urbihw.repeats": (),
    "urbihw.exitcodes": (),
    # How the user names the commands: for all that tell him to type one.
    "urbihw.started": (),
    # Where a bus worker listens besides its file.
    "urbihw.control_address": (),
    # The client's side of that socket: for the commands, the gateway and the metrics.
    "urbihw.control_line": ("urbihw.control_address",),
    # The version that is installed.
    "urbihw.release": (),
    # How an extra is installed: for who has to say so.
    "urbihw.extras": (),
    # Wires and robots.
    "urbihw.buses": (
        "urbihw.settings", "urbihw.backoff", "urbihw.extras", "urbihw.files", "urbihw.control_address",
    ),  # fmt: skip
    # Why a bus does not keep its rate: for the log of a robot, and for the verdict.
    "urbihw.buses.pace": (),
    # Maps, paths and scans for any base that drives; it knows no platform.
    "urbihw.navigation": (
        "urbihw.kernel.uobject", "urbihw.buses", "urbihw.settings", "urbihw.extras", "urbihw.files",
    ),  # fmt: skip
    # The loader and the daemon hold a robot by its base class, and know the kinds of its failures.
    "urbihw.platforms": (
        "urbihw.kernel.uobject", "urbihw.buses", "urbihw.settings", "urbihw.extras", "urbihw.platforms.expected",
        "urbihw.platforms.limits",
    ),  # fmt: skip
    # What the robots share: a robot on one wire.
    "urbihw.platforms.limits": ("urbihw.kernel.uobject", "urbihw.settings"),
    # It must know which names urbiscript takes.
    "urbihw.platforms.expected": (
        "urbihw.kernel.uobject", "urbihw.kernel.syntax", "urbihw.buses", "urbihw.settings", "urbihw.platforms.taken",
    ),  # fmt: skip
    "urbihw.platforms.devicelog": ("urbihw.repeats",),
    "urbihw.platforms.remembered": ("urbihw.files",),
    "urbihw.platforms.words": (),
    "urbihw.platforms.taken": (),
    "urbihw.platforms.identity": ("urbihw.kernel.uobject", "urbihw.settings"),
    "urbihw.platforms.hooks": ("urbihw.buses", "urbihw.figure", "urbihw.platforms.limits"),
    "urbihw.platforms.drawn": ("urbihw.kernel.uobject", "urbihw.figure", "urbihw.extras"),
    "urbihw.platforms.session": ("urbihw.kernel.uobject", "urbihw.buses", "urbihw.settings"),
    "urbihw.platforms.problems": ("urbihw.kernel.uobject", "urbihw.buses", "urbihw.platforms.devicelog"),
    "urbihw.platforms.guarded": (
        "urbihw.kernel.uobject", "urbihw.buses", "urbihw.control_address", "urbihw.platforms.devicelog",
        "urbihw.platforms.hooks",
    ),  # fmt: skip
    "urbihw.platforms.limited": (
        "urbihw.kernel.uobject", "urbihw.buses", "urbihw.platforms.channel", "urbihw.platforms.clipping",
        "urbihw.platforms.devicelog", "urbihw.platforms.hooks", "urbihw.platforms.limits",
    ),  # fmt: skip
    "urbihw.platforms.arrival": (
        "urbihw.kernel.uobject", "urbihw.buses", "urbihw.repeats", "urbihw.platforms.devicelog",
        "urbihw.platforms.guarded", "urbihw.platforms.hooks", "urbihw.platforms.problems",
        "urbihw.platforms.remembered",
    ),  # fmt: skip
    "urbihw.platforms.base": (
        "urbihw.kernel.uobject", "urbihw.buses", "urbihw.platforms.arrival", "urbihw.platforms.channel",
        "urbihw.platforms.devicelog", "urbihw.platforms.drawn", "urbihw.platforms.expected",
        "urbihw.platforms.guarded", "urbihw.platforms.hooks", "urbihw.platforms.identity",
        "urbihw.platforms.limited", "urbihw.platforms.limits",
        "urbihw.platforms.problems", "urbihw.platforms.remembered", "urbihw.platforms.session",
        "urbihw.platforms.words",
    ),  # fmt: skip
    "urbihw.platforms.channel": ("urbihw.kernel.uobject", "urbihw.buses"),
    "urbihw.platforms.clipping": ("urbihw.buses",),
    "urbihw.platforms.sound": ("urbihw.kernel.uobject",),
    "urbihw.platforms.speaker": (
        "urbihw.kernel.uobject", "urbihw.buses", "urbihw.platforms.channel", "urbihw.platforms.devicelog",
        "urbihw.platforms.sound",
    ),  # fmt: skip
    "urbihw.platforms.measured": ("urbihw.kernel.uobject", "urbihw.platforms.words"),
    "urbihw.platforms.jpeg": (),
    "urbihw.platforms.film": ("urbihw.extras", "urbihw.platforms.jpeg"),
    "urbihw.platforms.camera": (
        "urbihw.kernel.uobject", "urbihw.settings", "urbihw.platforms.channel", "urbihw.platforms.film",
        "urbihw.platforms.jpeg", "urbihw.platforms.streamed",
    ),  # fmt: skip
    "urbihw.platforms.streamed": ("urbihw.kernel.uobject", "urbihw.platforms.channel", "urbihw.platforms.words"),
    # A simulated world, looked at: the object of urbiscript, the process that draws, recordings.
    "urbihw.platforms.scene": (
        "urbihw.kernel.uobject", "urbihw.extras", "urbihw.files", "urbihw.platforms.streamed",
    ),  # fmt: skip
    # Motions recorded, kept and played, for every robot with joints.
    "urbihw.platforms.teach": (
        "urbihw.kernel.uobject", "urbihw.settings", "urbihw.files", "urbihw.platforms.devicelog",
    ),  # fmt: skip
    # Servos as objects, for every robot on a servo bus.
    "urbihw.platforms.servos": (
        "urbihw.kernel.uobject", "urbihw.buses", "urbihw.buses.pace", "urbihw.settings", "urbihw.figure",
        "urbihw.platforms.base",
        "urbihw.platforms.channel", "urbihw.platforms.expected", "urbihw.platforms.hooks", "urbihw.platforms.limits",
        "urbihw.platforms.devicelog", "urbihw.platforms.words", "urbihw.platforms.teach",
    ),  # fmt: skip
    ROBOT: (
        "urbihw.kernel.uobject", "urbihw.buses", "urbihw.settings", "urbihw.extras", "urbihw.figure",
        "urbihw.platforms.base",
        "urbihw.platforms.arrival", "urbihw.platforms.channel", "urbihw.platforms.expected", "urbihw.platforms.hooks",
        "urbihw.platforms.limits",
        "urbihw.platforms.devicelog", "urbihw.platforms.streamed", "urbihw.platforms.measured",
        "urbihw.platforms.camera", "urbihw.platforms.jpeg",
        "urbihw.platforms.speaker", "urbihw.platforms.sound", "urbihw.platforms.words", "urbihw.platforms.servos",
        "urbihw.platforms.teach", "urbihw.platforms.scene", "urbihw.navigation",
    ),  # fmt: skip
    # The Nao, a wheel of its own: its wire protocol is that of a bus, its platform that of a robot.
    "urbihw_nao.qimessaging": ("urbihw.buses", "urbihw.settings", "urbihw.extras"),
    "urbihw_nao": (
        "urbihw_nao.qimessaging", "urbihw.kernel.uobject", "urbihw.buses", "urbihw.settings", "urbihw.extras",
        "urbihw.platforms.arrival", "urbihw.platforms.base", "urbihw.platforms.channel", "urbihw.platforms.devicelog",
        "urbihw.platforms.hooks",
        "urbihw.platforms.limits", "urbihw.platforms.measured", "urbihw.platforms.speaker",
        "urbihw.platforms.streamed", "urbihw.platforms.teach", "urbihw.platforms.words",
    ),  # fmt: skip
    "urbihw_nao_fakes": ("urbihw_fakes",),
    # LeRobot's view of a robot: a client, as each neighbour.
    "lerobot_robot_urbihw": ("urbihw", "urbihw.client"),
    # The ways in.  "urbihw.kernel" alone is its door, Kernel; "urbihw.platforms" alone is the loader.
    "urbihw.daemon": (
        "urbihw.release",
        "urbihw.repeats",
        "urbihw.kernel",
        "urbihw.kernel.process",
        "urbihw.kernel.uobject",
        "urbihw.kernel.facade",
        "urbihw.kernel.server",
        "urbihw.kernel.lobby",
        "urbihw.robot",
        "urbihw.ros.script",
        "urbihw.platforms",
        # The world of a simulated robot.
        "urbihw.platforms.scene",
        "urbihw.buses",
        "urbihw.settings",
        "urbihw.extras",
        "urbihw.started",
        "urbihw.files",
        "urbihw.backoff",
        "urbihw.control_address",
        "urbihw.control_line",
        "urbihw.client",
        "urbihw.buses.verdict",
        # The rules for the names of a fleet.
        "urbihw.fleets.names",
    ),
    # What happens in a worker, recorded, shown and replayed: a client of the worker, never of the kernel or a platform.
    "urbihw.recording": ("urbihw.buses", "urbihw.control_line", "urbihw.backoff", "urbihw.extras", "urbihw.settings"),
    # What other people's programs see of a robot: clients of the daemon, each with a package of its own from outside.
    "urbihw.neighbours": ("urbihw.client", "urbihw.extras"),
    "urbihw.neighbours.assistant": ("urbihw.client", "urbihw.extras", "urbihw.neighbours"),
    "urbihw.neighbours.editor": ("urbihw.client", "urbihw.kernel.syntax"),
    "urbihw.neighbours.home": ("urbihw.backoff", "urbihw.client", "urbihw.neighbours"),
    "urbihw.neighbours.notebook": ("urbihw.client", "urbihw.kernel.syntax"),
    "urbihw.cli": (
        "urbihw.release",
        "urbihw.neighbours",
        "urbihw.neighbours.assistant",
        "urbihw.neighbours.editor",
        "urbihw.neighbours.home",
        "urbihw.neighbours.notebook",
        # To look at a simulated world.
        "urbihw.platforms.scene",
        # The rule for the names of motions, checked before a server is asked.
        "urbihw.platforms.teach",
        "urbihw.kernel",
        "urbihw.kernel.process",
        "urbihw.kernel.stages",
        "urbihw.kernel.uobject",
        "urbihw.kernel.facade",
        "urbihw.kernel.server",
        "urbihw.kernel.lobby",
        "urbihw.robot",
        "urbihw.ros.script",
        "urbihw.platforms",
        "urbihw.buses",
        "urbihw.settings",
        "urbihw.backoff",
        "urbihw.exitcodes",
        "urbihw.control_address",
        "urbihw.control_line",
        "urbihw.extras",
        "urbihw.started",
        "urbihw.daemon",
        "urbihw.remote",
        "urbihw.client",
        "urbihw.client.lines",
        "urbihw.client.values",
        # The words for a busy computer, which the verdict has, too.
        "urbihw.buses.pace",
        "urbihw.buses.verdict",
        "urbihw.web",
        "urbihw.recording",
        "urbihw.figure",
        "urbihw.fleets",
        "urbihw.fleets.names",
        "urbihw.ros",
        "urbihw.ros.robot",
        "urbihw.ros.script",
    ),
    # A client of the server and of the bus worker: never of the kernel or a platform.  It uses the daemon's state
    # folder.
    "urbihw.web": (
        "urbihw.client", "urbihw.client.lines", "urbihw.client.values", "urbihw.buses.verdict", "urbihw.daemon",
        "urbihw.backoff", "urbihw.repeats", "urbihw.release",
    ),  # fmt: skip
    # A client of the server and of the bus worker, too.  What others may read, write and call is what browsers may.
    "urbihw.fleets": (
        "urbihw.client", "urbihw.buses.verdict", "urbihw.daemon", "urbihw.web", "urbihw.backoff", "urbihw.release",
        "urbihw.repeats", "urbihw.fleets.names",
    ),  # fmt: skip
    "urbihw.fleets.names": ("urbihw.client",),
    # The verdict on the health of a robot, for commands and browsers.
    "urbihw.buses.verdict": ("urbihw.buses.pace",),
    # A process with devices of its own has a kernel, and a link to the kernel of a server.
    "urbihw.remote": (
        "urbihw.kernel.process", "urbihw.kernel.uobject", "urbihw.kernel.uremote", "urbihw.robot", "urbihw.client",
        "urbihw.backoff", "urbihw.exitcodes",
    ),  # fmt: skip
    # A node of ROS: never of the kernel, so that it can be a process of its own.
    "urbihw.ros": ("urbihw.backoff", "urbihw.repeats"),
    # A robot as a node: a client of the server and of the bus worker.
    "urbihw.ros.robot": (
        "urbihw.ros", "urbihw.client", "urbihw.client.lines", "urbihw.buses.verdict", "urbihw.daemon", "urbihw.backoff",
        "urbihw.repeats",
    ),  # fmt: skip
    # Ros of urbiscript: the kernel's end of that process.
    "urbihw.ros.script": ("urbihw.ros", "urbihw.kernel.library", "urbihw.extras"),
    # How a server is reached.  What it says is read in one place, for commands and for devices in another process.
    "urbihw.client": ("urbihw.client.lines", "urbihw.client.values", "urbihw.started"),
    "urbihw.client.lines": (),
    "urbihw.client.values": ("urbihw.client.lines",),
    # A program that uses a robot says urbihw.connect, one that uses several urbihw.fleet.
    "urbihw": ("urbihw.client", "urbihw.fleets"),
    # Simulated robots: nothing of urbihw, so that driver and fake cannot share a mistake.
    "urbihw_fakes": (),
}

ALL_OF_THE_KERNEL = "urbihw.kernel.boot"
"""The one module for which "urbihw.kernel" means everything in it."""

LIBRARIES: dict[str, str] = {
    # Who alone may import a library from outside; the standard library is open to all.
    "greenlet": "urbihw.kernel.sched",
    "lark": "urbihw.kernel.syntax",
    "serial": "urbihw.buses",
    "mcp": "urbihw.neighbours.assistant",
    "zenoh": "urbihw.fleets",
    "ipykernel": "urbihw.neighbours.notebook",
    "aiomqtt": "urbihw.neighbours.home",
    "pygls": "urbihw.neighbours.editor",
    "lerobot": "lerobot_robot_urbihw",
}

BYTES_ONLY = ("packet.py", "protocol.py", "framing.py", "remote.py", "crc.py")
"""Files that turn bytes into values and back: no I/O and no time."""

NOT_FOR_BYTES = ("socket", "serial", "time", "asyncio", "threading", "select", "os")


# ---------------------------------------------------------------- reading


def modules(root: Path) -> dict[str, Path]:
    """Every module of the product by its dotted name."""
    found = {}
    for base, top in ROOTS:
        folder = root / base
        for path in sorted((folder / top).rglob("*.py")):
            parts = path.relative_to(folder).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imports(path: Path, known: dict[str, Path]) -> Iterator[tuple[int, str]]:
    """What a file imports, anywhere in it and for whatever reason: (line, dotted name)."""
    for node in ast.walk(ast.parse(path.read_text("utf-8"), str(path))):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            source = "." * node.level + (node.module or "")
            for alias in node.names:
                inner = f"{source}.{alias.name}"
                yield node.lineno, inner if inner in known else source


def area(name: str, known: dict[str, Path]) -> str:
    """The row of the table a module belongs to; for a robot, the robot's own package."""
    parts = name.split(".")
    if parts[:2] == ["urbihw", "platforms"] and len(parts) > 2:
        package = ".".join(parts[:3])
        if known.get(package, Path()).name == "__init__.py":
            return package
    while parts:
        if ".".join(parts) in MAY_IMPORT:
            return ".".join(parts)
        parts.pop()
    return ""


def allowed(of: str, target: str) -> bool:
    """Whether area ``of`` may import from area ``target``."""
    if of == target or (target in EVERYWHERE and of not in SIMULATED):
        return True
    row = of if of in MAY_IMPORT else ROBOT
    if row == ALL_OF_THE_KERNEL:
        return target.startswith("urbihw.kernel")
    return target in MAY_IMPORT[row]


def offences(root: Path) -> list[str]:
    """Every import that breaks a rule, as ``file:line: who imports what``."""
    known = modules(root)
    found = []
    for name, path in known.items():
        own = area(name, known)
        for line, target in dict.fromkeys(imports(path, known)):
            where = f"{path.relative_to(root)}:{line}: {name} imports {target}"
            library = target.partition(".")[0]
            if target.startswith("."):
                found.append(f"{where}: imports are absolute")
            elif library in (top for _, top in ROOTS):
                if not allowed(own, area(target, known)):
                    found.append(where)
            elif library in LIBRARIES and own != LIBRARIES[library]:
                found.append(f"{where}: only {LIBRARIES[library]} may")
            elif path.name in BYTES_ONLY and library in NOT_FOR_BYTES:
                found.append(f"{where}: bytes only, no I/O and no time")
            elif library in ("tests", "bench", "pytest"):
                found.append(f"{where}: the product knows no tests")
    return found


# ---------------------------------------------------------------- the tests


def test_the_tree_keeps_the_rules() -> None:
    assert "\n".join(offences(ROOT)) == ""


def test_every_package_says_what_it_is_for() -> None:
    packages = [path for path in modules(ROOT).values() if path.name == "__init__.py"]
    silent = [str(path.relative_to(ROOT)) for path in packages if not ast.get_docstring(ast.parse(path.read_text()))]
    assert silent == []


def test_every_folder_with_code_is_a_package() -> None:
    known = modules(ROOT)
    bare = {str(path.parent.relative_to(ROOT)) for path in known.values() if not (path.parent / "__init__.py").exists()}
    assert bare == set()


CLIENTS = {
    "urbihw/client/connect.py": "a lobby, with a blocking socket",
    "urbihw/client/dial.py": "a lobby, with asyncio",
    "urbihw/control_line.py": "the control socket of a worker",
    "urbihw/daemon/control_client.py": "reads the socket of control_line with asyncio",
    "urbihw/buses/tcp.py": "a robot",
    "urbihw/kernel/stdlib/socket_channel.py": "whatever a program in urbiscript names",
    "urbihw/kernel/server/acceptor.py": "looks whether another server has the path",
    "urbihw/cli/reach.py": "looks whether a daemon listens",
    "urbihw/daemon/dead_sockets.py": "looks whether a process listens",
    "urbihw/daemon/service.py": "looks whether another daemon has the control socket",
}
"""The files that connect to a socket.  Each kind of server has one client, which all others use."""


def test_each_socket_has_one_client() -> None:
    connects = re.compile(r"unix_connection\(|create_connection\(|\.connect(?:_ex)?\((?:address|path|str\(path\))\)")
    files = (ROOT / "urbihw").rglob("*.py")
    assert {str(path.relative_to(ROOT)) for path in files if connects.search(path.read_text())} == {*CLIENTS}


BROKEN = [
    ("urbihw/kernel/sched/a.py", "from urbihw.kernel.runtime.object import Obj", "urbihw.kernel.runtime.object"),
    ("urbihw/kernel/runtime/a.py", "def f():\n    import urbihw.kernel.compiler.bind", "urbihw.kernel.compiler.bind"),
    ("urbihw/kernel/facade.py", "from urbihw.kernel.runtime import world", "urbihw.kernel.runtime"),
    ("urbihw/kernel/server/a.py", "from urbihw.kernel import facade", "urbihw.kernel.facade"),
    ("urbihw/kernel/stdlib/a.py", "from urbihw.robot import interface", "urbihw.robot"),
    ("urbihw/robot/a.py", "from urbihw.kernel.runtime.object import Obj", "urbihw.kernel.runtime.object"),
    ("urbihw/buses/a.py", "from urbihw.kernel import Kernel", "urbihw.kernel"),
    ("urbihw/platforms/bioloid/a.py", "from urbihw.platforms.nxt import b", "urbihw.platforms.nxt"),
    ("urbihw/platforms/bioloid/a.py", "from urbihw.kernel.runtime.object import Obj", "urbihw.kernel.runtime.object"),
    ("urbihw/navigation/a.py", "from urbihw.platforms.nxt import b", "urbihw.platforms.nxt"),
    ("urbihw/daemon/a.py", "from urbihw.platforms.bioloid import devices", "urbihw.platforms.bioloid"),
    ("urbihw/daemon/a.py", "from urbihw.kernel.runtime import world", "urbihw.kernel.runtime"),
    ("urbihw/neighbours/assistant/a.py", "from urbihw.buses import link", "urbihw.buses"),
    ("fakes/urbihw_fakes/a.py", "from urbihw.buses import link", "urbihw.buses"),
    ("urbihw/daemon/a.py", "from urbihw_nao import driver", "urbihw_nao"),
    ("packages/nao/urbihw_nao/qimessaging/a.py", "from urbihw_nao import driver", "urbihw_nao"),
    ("packages/nao/urbihw_nao/a.py", "from urbihw.kernel.runtime.object import Obj", "urbihw.kernel.runtime.object"),
    ("urbihw/cli/a.py", "from .main import main", ".main: imports are absolute"),
    ("urbihw/buses/a.py", "import greenlet", "greenlet: only urbihw.kernel.sched may"),
    ("fakes/urbihw_fakes/a.py", "from urbihw.frozen import frozen", "urbihw.frozen"),
    ("urbihw/buses/packet.py", "import time", "time: bytes only, no I/O and no time"),
]


@pytest.mark.parametrize(("file", "text", "message"), BROKEN, ids=[f"{file}: {text[:40]}" for file, text, _ in BROKEN])
def test_a_broken_rule_is_found(tmp_path: Path, file: str, text: str, message: str) -> None:
    for name in ("urbihw/kernel/facade.py", "urbihw/platforms/bioloid/__init__.py", "urbihw/platforms/nxt/__init__.py"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / file).write_text(text)
    (found,) = offences(tmp_path)
    assert found.startswith(file) and found.endswith(f"imports {message}")
