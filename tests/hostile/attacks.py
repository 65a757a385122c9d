"""The hostile list: what an attacker or a careless neighbour does to a server, one row each.  Add yours.

A row says bytes, which each of its connections sends at once, or is a function that does what it likes with sockets.
``attack_lab`` plays a row against a real server, ``test_attacks`` those marked ``ci``, and ``python -m bench.hostile``
all of them, with figures.

In bytes, ``@FOLDER@`` is a folder of the row and ``@PORT@`` the port of the server.  A program that makes a file
``pwned`` there has run what must not run.

This file is also the program of the attacker: ``python attacks.py NAME PORT FOLDER``.  It attacks until it is killed.
"""

from __future__ import annotations

import itertools
import os
import random
import selectors
import socket
import ssl
import struct
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

CONNECT = 5.0
"""Seconds for which a connection is waited for."""
HEARD = 400
"""Bytes of what an attacker reads that are shown."""
TURN = 0.05
"""Seconds of one look at the sockets."""


@dataclass(frozen=True)
class Attack:
    """One row.

    Attributes:
        name: says what is done.
        says: what each connection sends, or what the attacker does.
        connections: how many, for bytes.
        holds: how often each of its connections may hold the interpreter on purpose until the limit of the server ends
            that, perhaps one time after the other.
        reads: whether the attacker reads its answers, for bytes.
        seconds: for which the neighbour is looked at.
        spoils: errors count as answers to the neighbour: what is attacked is shared by all, and an error tells so.
        leaves: the attacker is gone before a new connection is tried; it has taken all there are.
        ends: it ends the server, which any client may do; the robot stands then.
        descriptors: how many the server may have open; 0: as many as usual.
        memory: how many MB the server may grow by.
        ci: one of those that run with the tests.
    """

    name: str
    says: bytes | Callable[[Field], None]
    connections: int = 1
    reads: bool = True
    seconds: float = 3.0
    spoils: bool = False
    leaves: bool = False
    holds: int = 0
    ends: bool = False
    descriptors: int = 0
    memory: float = 300.0
    ci: bool = False


BEGINS = "begins"
"""The file in the folder that tells of the beginning of the attack."""


class Field:
    """What an attacker has to work with."""

    def __init__(self, port: int, folder: Path) -> None:
        self.port = port
        self.folder = folder
        self._heard = 0

    def connect(self, receive: int = 0) -> socket.socket:
        """A connection; ``receive`` is the size of the operating system's buffer for what comes in.  Raises OSError."""
        made = socket.socket()
        if receive:
            made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive)
        made.settimeout(CONNECT)
        made.connect(("127.0.0.1", self.port))
        return made

    def here(self, says: bytes) -> bytes:
        """A text of the table, for this folder and port."""
        return says.replace(b"@FOLDER@", str(self.folder).encode()).replace(b"@PORT@", str(self.port).encode())

    def tell(self, data: bytes) -> None:
        """Show the beginning of what was read."""
        shown = data[: HEARD - self._heard]
        self._heard += len(shown)
        if shown:
            print(shown.decode("latin-1"), end="", flush=True)


# ---------------------------------------------------------------- how bytes are sent


class _Line:
    """One connection, with what it has still to send."""

    def __init__(self, to: socket.socket, data: bytes) -> None:
        self.socket = to
        self.data = memoryview(data)


def play(field: Field, says: bytes, connections: int, reads: bool = True) -> None:
    """Send the same from some connections, and read what comes; those that were closed are not opened again."""
    data = field.here(says)
    chooser = selectors.DefaultSelector()
    for _ in range(connections):
        try:
            made = field.connect(receive=0 if reads else 4096)
        except OSError:
            continue
        made.setblocking(False)
        chooser.register(made, selectors.EVENT_WRITE | selectors.EVENT_READ * reads, _Line(made, data))
    while True:
        if not chooser.get_map():
            time.sleep(TURN)
            continue
        for key, mask in chooser.select(TURN):
            line: _Line = key.data
            try:
                if mask & selectors.EVENT_WRITE:
                    line.data = line.data[line.socket.send(line.data[: 1 << 16]) :]
                    if not line.data and reads:
                        chooser.modify(line.socket, selectors.EVENT_READ, line)
                    elif not line.data:
                        chooser.unregister(line.socket)
                        _kept.append(line.socket)
                if mask & selectors.EVENT_READ:
                    heard = line.socket.recv(1 << 16)
                    field.tell(heard)
                    if not heard:
                        raise ConnectionError
            except BlockingIOError:
                continue
            except OSError:
                chooser.unregister(line.socket)
                line.socket.close()


_kept: list[socket.socket] = []
"""Connections of which nothing is read."""


def _turns(seconds: float = 0.0) -> Iterator[int]:
    """For ever, with a pause."""
    for turn in itertools.count():
        yield turn
        time.sleep(seconds)


def _say(to: socket.socket, data: bytes) -> bool:
    """Send; False when the server has hung up."""
    try:
        to.sendall(data)
        return True
    except OSError:
        return False


def _hear(field: Field, at: socket.socket, seconds: float = 0.5) -> bytes:
    """What comes within some time."""
    at.settimeout(seconds)
    try:
        heard = at.recv(1 << 16)
    except OSError:
        return b""
    field.tell(heard)
    return heard


# ---------------------------------------------------------------- attackers with sockets

POST = (
    b"POST / HTTP/1.1\r\nHost: 127.0.0.1:54000\r\nOrigin: http://evil.example\r\nContent-Type: text/plain\r\n"
    b"Content-Length: 62\r\n\r\n*/;System.system(\"touch @FOLDER@/pwned\");shutdown;\r\n"
)
FORM = (
    b"POST /x HTTP/1.1\r\nHost: a\r\nContent-Type: multipart/form-data; boundary=b\r\nContent-Length: 120\r\n"
    b"\r\n--b\r\nContent-Disposition: form-data; name=\"a\"\r\n\r\n"
    b";System.system(\"touch @FOLDER@/pwned\");shutdown;\r\n--b--\r\n"
)
SOCKET = (
    b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nCookie: ;System.system(\"touch @FOLDER@/pwned\");\r\n\r\n"
    b"\x81\x05;1+1;"
)
GET = b"GET /;System.system(\"touch @FOLDER@/pwned\");shutdown; HTTP/1.0\r\n\r\n"
HTTP2 = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\x00\x00\x00\x04\x00\x00\x00\x00\x00;shutdown;"


def _client_hello() -> bytes:
    """The first bytes of a TLS client."""
    context = ssl.create_default_context()
    out = ssl.MemoryBIO()
    try:
        context.wrap_bio(ssl.MemoryBIO(), out, server_hostname="localhost").do_handshake()
    except ssl.SSLWantReadError:
        pass
    return out.read()


def _in_pieces(says: bytes) -> Callable[[Field], None]:
    """The same, byte by byte, then a second request on the same connection."""

    def run(field: Field) -> None:
        for _ in _turns(0.01):
            line = field.connect()
            line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            for byte in field.here(says):
                if not _say(line, bytes((byte,))):
                    break
                time.sleep(0.002)
            _say(line, field.here(says))
            _hear(field, line)
            line.close()

    return run


def _again(says: bytes, pause: float = 0.0, hear: float = 0.05) -> Callable[[Field], None]:
    """As a page does that tries again and again."""

    def run(field: Field) -> None:
        for _ in _turns(pause):
            try:
                line = field.connect()
            except OSError:
                continue
            _say(line, field.here(says))
            _hear(field, line, hear)
            line.close()

    return run


def _crowd(count: int) -> Callable[[Field], None]:
    """As many connections as can be had, each with a question; those that were closed are opened again."""

    def run(field: Field) -> None:
        lines: list[socket.socket] = []
        for _ in _turns(0.01):
            for _ in range(50):
                if len(lines) >= count:
                    break
                try:
                    line = field.connect()
                except OSError:
                    break
                _say(line, b"1;\n")
                lines.append(line)
            for line in lines[:]:
                line.setblocking(False)
                try:
                    heard = line.recv(4096)
                except BlockingIOError:
                    continue
                except OSError:
                    heard = b""
                field.tell(heard)
                if not heard:
                    line.close()
                    lines.remove(line)

    return run


def _slow(field: Field) -> None:
    """A hundred that type a statement at a byte a second."""
    lines = [field.connect() for _ in range(100)]
    text = b"every (1s) { echo(12345) }; var x = [1, 2, 3];\n"
    for turn in _turns(1.0):
        for line in lines:
            _say(line, text[turn % len(text) :][:1])


def _deaf(field: Field) -> None:
    """Twenty that ask for much and read a little now and then."""
    lines = [field.connect(receive=4096) for _ in range(20)]
    for line in lines:
        _say(line, b'every (10ms) echo("x" * 20000);\n')
    for _ in _turns(0.2):
        for line in lines:
            line.setblocking(False)
            try:
                line.recv(100)
            except OSError:
                pass


def _resets(field: Field) -> None:
    """Connections that are reset in the middle of an answer."""
    for _ in _turns(0.002):
        line = field.connect(receive=4096)
        line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        _say(line, b'for (300) echo("x" * 10000); every (10ms) { 1 }, at (System.ndebug) {}; sleep(1h); "half')
        line.settimeout(0.02)
        try:
            line.recv(100)
        except OSError:
            pass
        line.close()


def _comings(field: Field) -> None:
    """Connections that come and go without a word."""
    for _ in _turns():
        field.connect().close()


def _random(field: Field) -> None:
    """Bytes without any sense, from ever new connections."""
    chance = random.Random(54000)
    for _ in _turns(0.01):
        line = field.connect()
        _say(line, chance.randbytes(chance.choice((10, 1000, 100_000))))
        # A server that is slow to answer is sent the next ones later.
        _hear(field, line, 0.2)
        line.close()


_WORDS = (
    b"motor6 var x if else for while ( ) { } [ ] ; , | & : ! ? ~ . -> => = += ++ 1 0x 1s \" ' /* */ // at every "
    b"function "
    b"return break this call new class try catch throw \\ \r\n \0 \xff BIN 10 do tag: lobby System Object onleave"
).split(b" ")


def _word_salad(field: Field) -> None:
    """Words of the language in any order."""
    chance = random.Random(54001)
    for _ in _turns(0.01):
        line = field.connect()
        _say(line, b" ".join(chance.choices(_WORDS, k=2000)) + b";\n")
        _hear(field, line, 0.02)
        line.close()


def _half_closed(field: Field) -> None:
    """Clients that end their sending side, of which each waits for an answer."""
    for _ in _turns(0.05):
        line = field.connect()
        _say(line, b'sleep(300ms); echo("late");\n')
        line.shutdown(socket.SHUT_WR)
        _hear(field, line, 1.0)
        line.close()


def _loads(field: Field) -> None:
    """``load`` of what is no program: without end, huge, a folder, a pipe, a link to itself, links and ``..``."""
    here = field.folder
    (here / "huge.u").write_bytes(b"var huge = [" + b"1, " * 5_000_000 + b"1]|;\n")
    (here / "long.u").write_bytes(b"1;\n" * 500_000)
    os.mkfifo(here / "pipe.u")
    (here / "loop.u").symlink_to(here / "loop.u")
    (here / "link.u").symlink_to("../../../../../../etc/passwd")
    (here / "self.u").write_text(f'load("{here}/self.u");\n')
    names = ["long.u", "pipe.u", "loop.u", "link.u", "self.u", "../../../etc/passwd", ".", "missing.u", "huge.u"]
    paths = [str(here / name) for name in names] + ["/dev/zero", "/dev/stdin", "/proc/self/mem", "/dev/full", "a\\0b"]
    lines = []
    for path in paths:
        line = field.connect()
        _say(line, f'load("{path}"); File.new("{path}").content.size;\n'.encode())
        lines.append(line)
    for _ in _turns(0.1):
        for line in lines:
            _hear(field, line, 0.01)


def _binary_mode(field: Field) -> None:
    """Remotes whose frames say that they are longer than they are, and more than there is."""
    chance = random.Random(54002)
    for _ in _turns(0.02):
        line = field.connect()
        _say(line, b'binaryMode(true, "mode");\n')
        _hear(field, line, 0.1)
        code = bytes((chance.randrange(8),))
        _say(line, code + b"\xff\xff\xff\xff" * 4 + chance.randbytes(200))
        _say(line, chance.randbytes(100_000))
        _hear(field, line, 0.02)
        line.close()


def _takes_over(field: Field) -> None:
    """A remote that says that what exists is its own."""
    first, second = field.connect(), field.connect()
    _say(first, b"external object Thing; external var Thing.v from Thing; external function(1) Thing.f from Thing;\n")
    _hear(field, first, 0.1)
    for _ in _turns(0.02):
        for name in (b"Thing", b"motor6", b"System", b"Object", b"lobby", b"bioloid", b"Float"):
            _say(second, b"external object %s; external var %s.val from %s;\n" % (name, name, name))
            _say(second, b"external function(0) %s.stop from %s; external event(0) %s.e from %s;\n" % ((name,) * 4))
        _hear(field, second, 0.02)


# ---------------------------------------------------------------- programs

BUILT_IN = (
    "Object", "Global", "Lobby", "System", "Tag", "Job", "List", "String", "Float", "Event", "Exception", "Code",
    "true", "Channel", "Dictionary", "Primitive", "nil", "void", "Control", "UObject", "UVar",
)  # fmt: skip
"""What is shared by all, whose slots are removed, replaced and emptied in turn."""

_IN_TURN = """
var names = {thing}.localSlotNames|;
for| (var name : names)
  if (name != "{last}") try {{ {do} }} catch {{}};
for| (var name : ["{last}"]) try {{ {do} }} catch {{}};
"""


def _sabotages() -> Iterator[Attack]:
    """Each of what all share: its slots removed, replaced, and itself without prototypes."""
    for thing in BUILT_IN:
        removed = _IN_TURN.format(thing=thing, last="removeSlot", do=f"{thing}.removeSlot(name)")
        replaced = f"{thing}.removeSlot(name) | {thing}.setSlot(name, 3)"
        replaced = _IN_TURN.format(thing=thing, last="setSlot", do=replaced)
        written = _IN_TURN.format(thing=thing, last="updateSlot", do=f"{thing}.updateSlot(name, nil)")
        first = thing in ("Object", "Lobby")
        yield Attack(f"sabotage: every slot of {thing} removed", removed.encode(), spoils=True, ci=first)
        yield Attack(f"sabotage: every slot of {thing} replaced", replaced.encode(), spoils=True)
        yield Attack(f"sabotage: nil in every slot of {thing}", written.encode(), spoils=True)
        yield Attack(f"sabotage: {thing}.protos = []", f"{thing}.protos = [];".encode(), spoils=True)


def _programs(rows: dict[str, str], *, memory: float = 300.0, holds: int = 0, **more: bool) -> Iterator[Attack]:
    for name, text in rows.items():
        yield Attack(name, text.encode() + b"\n", memory=memory, holds=holds, **more)


_HELD = {
    "a loop that never gives way, again and again": "loop| { try { loop| {} } catch {} },",
    "a loop in finally": "try { loop| {} } finally { loop| {} };",
    "a loop in a getter": "var Global.Slow = Object.new| Slow.setProperty(\"x\", \"get\", 1)|; "
    "Slow.'y' = 1| function Slow.asString() { loop| {} }|; Slow; echo(Slow); throw Slow;",
    "a loop in a condition": "var Global.c = 0|; function f() { loop| {} | c }|; at (c > f()) { 1 }; c = 1;",
    "a loop in a tag's event": "var t = Tag.new|; at (t.enter?) { loop| {} }; t: { 1 };",
    "a loop for a sort": "for| (var i : 1000000) { [2, 1].sort(closure (a, b) { loop| {} }) };",
    "a recursion that is caught": "function f() { try { f() } catch { f() } }; f();",
}
MAX_HOLDS = 3
"""So often may the jobs of a connection be ended by the limit before all of them are (``urbihw.kernel.server``)."""
_HELD_AGAIN = {
    "a loop in onDisconnect": "at (Lobby.onDisconnect?(var l)) { loop| {} }; Lobby.create.quit;",
}
_HELD_MEMORY = {
    "a string that doubles": 'var s = "x"|; loop| { s = s + s };',
    "a list that grows": "var l = []|; loop| { l << [l.size] };",
    "dictionaries in dictionaries": 'var d = ["a" => 1]|; loop| { d = ["a" => d, "b" => d] },',
    "10 000 prototypes": "var o = Object.new|; for| (10000) o.addProto(Object.new); o.nothing; o;",
    "a million slots": 'var o = Object.new|; for| (var i : 1000000) o.setSlot("s" + i, i); o.localSlotNames.size;',
    "10 000 tags": "var tags = []|; for| (10000) tags << Tag.new; for| (var t : tags) detach({ t: sleep(1h) });"
    " for| (var t : tags) t.freeze; for| (var t : tags) t.stop;",
    "10 000 channels": 'for| (var i : 10000) { Channel.new("c" + i) << i };',
    "10 000 variables of a device": 'var u = UObject.new|; for| (var i : 10000) UVar.new(u, "v" + i);',
    "10 000 timers": "for| (var i : 10000) detach({ every (10ms) { i } });",
}
"""A `|` runs in one go, as the language promises, and so does a `for|`: it ends, or the limit of the server ends it."""
_HELD_OTHERS = {
    "everything printed without end": "Object.asToplevelPrintable = function () { loop| {} }; Object.asString = "
    "function () { loop {} }; Float.asString = function () { loop| {} };"
    " Float.asToplevelPrintable = function () { loop {} };",
}
_MEMORY = {
    "jobs that fork jobs": "function fa() { fa() & fa() }; fa();",
    "jobs in the background that fork jobs": "function fb() { fb(), fb(), }; fb();",
    "detached jobs without end": "loop { detach({ sleep(1h) }) },",
    "a lobby that is handed text without end": 'loop { lobby.receive("x" * 1e7) };',
    "a lobby that is handed text without end, beside": 'loop { lobby.receive("x" * 1e7) },',
    "a list that holds itself": "var l = [1]|; for| (40) l = [l, l]; l; l == l; l.asString.size;",
    "products that are too long": '("x" * 1e12).size; ("x" * 1e10).size; ([1] * 1e10).size; 1e10.seq.size;',
    "objects that derive from each other": "var o = Object.new|; for| (5000) o = o.clone; o.nothing;"
    " o.asString; o.protos;",
}
_BUILT_IN = {
    "a string of 20 MB that is split": 'var s = "abcdefgh ," * 2000000|; loop { s.split(",").size; s.split.size },',
    "a string that is split at itself": 'var s = "abcdefgh ," * 2000000|; loop { s.split(s).size; s.split([s, s]) },',
    "a string of 20 MB that is searched": 'var s = "ab" * 10000000|; loop { s.replace("ab", "c").size; s.isAlpha;'
    " s.asPrintable.size; s.distance(s); s.closest([s, s]) },",
    "a million digits that are no number": 'var s = "1" * 1000000 + "x"|; loop { s.asFloat },',
    "a list of two millions that is sorted": "var l = 2000000.seq|; loop { l.sort.size; l.max;"
    " l = l.map(closure (a) { a * 7919 % 1000003 }) },",
    "a million strings that are sorted": 'var l = ("ab,cd," * 500000).split(",")|; loop { l.sort; l.remove(1) },',
    "lists of a million that are compared": "var l = 1000000.seq|; var m = l + []|; loop { l == m; l < m; l.has(-1) },",
    "a list of a million that is printed": "var l = 1000000.seq|; loop { l.asString.size; [l, l].asString.size },",
    "members that are looked for in each other": "var l = 100000.seq|; loop { l - (l + []); [-1].subset(l) },",
    "a format of a million pieces": 'loop { (("%%" * 1000000) % []).size },',
}
_CROWDS = {
    "work that gives way without end": "for (20) detach({ while (true) { 1; 2 } });",
    "`every` without a pause": "every (0) { 1 }, every (1ms) { for| (1000) 1 },",
    "2000 at": "var Global.level = 0|; for| (2000) { at (level > 1) echo(1) onleave echo(2) };"
    " every (1ms) level = 3 - level,",
    "an event that emits itself": "var e = Event.new|; at (e?) e!; e!;",
    "an event that emits itself later": "var e = Event.new|; at (e?) { sleep(0); e! }; e!;",
    "two events that emit each other twice": "var e = Event.new|; var f = Event.new|; at (e?) { f! & f! };"
    " at (f?) { e!, e! }; e!;",
    "a flood for all": 'loop { wall("x" * 100) },',
    "events with payloads without end": "var e = Event.new|; for (1000) { at (e?(var x)) { [x] } };"
    " loop { e!([1, 2, 3]) },",
}
_TEXTS = {
    "a list of 100 000": "[" + "1, " * 100_000 + "1].size;",
    "a sum of 50 000": "1" + " + 1" * 50_000 + ";",
    "a function of 20 000 statements": "function f() {" + "var x = 1; x + 1;\n" * 20_000 + "};",
    "100 000 open brackets": "[" * 100_000 + ";",
    "100 000 open parentheses": "(" * 100_000 + ";",
    "100 000 open braces": "{" * 100_000 + ";",
    "50 000 brackets, closed": "[" * 50_000 + "]" * 50_000 + ";",
    "a name of 10 MB": "x" * 10_000_000 + ";",
    "a string of 50 MB": '"' + "x" * 50_000_000 + '".size;',
    "a comment of 50 MB": "/*" + "*" * 50_000_000 + "/ 1;",
    "100 000 functions": "function f() { 1 };\n" * 100_000,
    "a million statements": "1;" * 1_000_000,
    "a million syntax errors": "1 + ;" * 200_000,
    "an if of 2000 levels": "if (true) " * 2000 + "1;",
    "eval of a huge text": 'eval("[" + "1, " * 300000 + "1]").size;',
    "a binary that never comes": "BIN 999999999999999;abc",
    "a binary of 4 GB": "BIN 4294967296;" + "x" * 1_000_000,
    "a blob in a string that never comes": '"\\B(999999999999999)(abc',
    "printing of a huge list": "(1000000).seq; [1000000.seq, 1000000.seq];",
}
_OTHERS = {
    "all jobs terminated": "loop { System.jobs.each(closure (j) { try { j.terminate } catch {} }); sleep(10ms) },",
    "all lobbies blocked": "Lobby.instances.each(closure (l) { if (l !== lobby) l.connectionTag.block });",
    "all lobbies frozen": "Lobby.instances.each(closure (l) { if (l !== lobby) l.connectionTag.freeze });",
    "all lobbies stopped": "loop {"
    " Lobby.instances.each(closure (l) { if (l !== lobby) l.connectionTag.stop }); sleep(10ms) },",
    "all others hung up on": "Lobby.instances.each(closure (l) { if (l !== lobby) l.quit });",
    "all tags of all jobs frozen": "System.jobs.each(closure (j) {"
    " j.tags.each(closure (t) { try { t.freeze } catch {} }) });",
    "all tags of all jobs blocked": "System.jobs.each(closure (j) {"
    " j.tags.each(closure (t) { try { t.block } catch {} }) });",
    "Tag itself frozen and blocked": "Tag.freeze; Tag.block; Tag.stop;",
    "Global without System": 'Global.removeSlot("System"); System;',
    "Global without the robot": 'Global.removeSlot("bioloid"); Global.removeSlot("robot");'
    ' Global.removeSlot("motors");',
    "Object without prototypes": "Object.protos = [];",
    "Object derives from what derives from it": "Object.addProto(List); Object.addProto(lobby);"
    " Global.addProto(System);",
    "a robot without a stop": "robot.stop = 3; bioloid.stop = 3; robot.estop = 3; bioloid.release = 3;",
    "operators that lie": "Float.'+' = function (x) { 42 }; Float.'==' = function (x) { true };",
    "printing that fails": 'Object.asToplevelPrintable = function () { throw "no" }; Object.asString = function () '
    '{ throw "no" }; Float.asString = function () { throw "no" }; Exception.asString = function () { throw "no" };',
    "a lobby whose slots hang": "Lobby.topLevel = Object.new|; Lobby.echo = function (x) { loop {} }; Lobby.send = 3;",
}
_OUTSIDE = {
    "a program that writes without end": 'var p = Process.new("yes", [])|; p.run; p.stdout.asList.size;',
    "a program that never ends": 'System.system("sleep 20");',
    "a file without end": 'File.new("/dev/zero").content; InputStream.new(File.new("/dev/zero")).getLine;',
    "a pipe that nobody writes to": 'System.system("mkfifo @FOLDER@/fifo"); File.new("@FOLDER@/fifo").content;'
    ' load("@FOLDER@/fifo");',
    "a socket to nobody": 'var s = Socket.new|; s.connect("127.0.0.1", "9");',
    "a ring of sockets that doubles what it hears": "for (var i : 30) { var s = Server.new|"
    " at (s.connection?(var c)) { at (c.received?(var d)) c.write(d + d) }|"
    ' s.listen("127.0.0.1", "0")| var o = Socket.new| at (o.received?(var d)) o.write(d + d)|'
    ' o.connect("127.0.0.1", s.port)| o.write("x") };',
    "a socket that sends single bytes": 'var s = Server.new|; at (s.connection?(var c)) { at (c.received?(var d))'
    ' { sleep(1h) } }; s.listen("127.0.0.1", "0"); var o = Socket.new|; o.connect("127.0.0.1", s.port);'
    " loop { o.syncWrite(\"x\") },",
    "clients that make clients by sockets": "function Global.grow() { var s = Socket.new|"
    ' s.connect("127.0.0.1", @PORT@)| s.write("Global.grow();\n") }|; for (300) { try { grow() } catch {} };',
    "300 programs": 'for| (300) { Process.new("sleep", ["3"]).run };',
    "30 programs that write without end, read": "for| (30) detach({"
    ' var p = Process.new("yes", [])|; p.run; loop { p.stdout.getLine } });',
    "30 programs that write without end, read at once": "for| (30) detach({"
    ' var p = Process.new("yes", [])|; p.run; p.stdout.asList.size });',
    "3000 that wait for a pipe": 'System.system("mkfifo @FOLDER@/in @FOLDER@/out @FOLDER@/all");'
    ' for| (1000) detach({ try { InputStream.new(File.new("@FOLDER@/in")).getLine } catch {} });'
    ' for| (1000) detach({ try { OutputStream.new(File.new("@FOLDER@/out")) << 1 } catch {} });'
    ' for| (1000) detach({ try { File.new("@FOLDER@/all").content } catch {} });',
    "40 devices without end": 'for| (var name : ["/dev/zero", "/dev/urandom"]) for| (20) detach({'
    " loop { try { File.new(name).content } catch {} } });",
    "a pipe without end": "System.system(\"mkfifo @FOLDER@/full; timeout 10 sh -c 'yes > @FOLDER@/full' &\");"
    ' loop { try { File.new("@FOLDER@/full").content } catch (var e) { e.print } };',
}
_REGEXPS = {
    "a regexp without end": 'Regexp.new("(a+)+$").match("a" * 60 + "b");',
    "regexps without end, in a loop": 'loop { try { Regexp.new("(a|aa)+$").match("a" * 100 + "b") } catch {} },',
    "a regexp that is huge": 'Regexp.new("(" * 5000 + ")" * 5000); Regexp.new("a{1,60000}{1,60000}"); '
    'Regexp.new("(x?){3000}" + "x{3000}").match("x" * 3000);',
}

INNOCENT = "nobody attacks"
"""The row that shows that what is looked at is right when there is nothing to see."""

ATTACKS: tuple[Attack, ...] = (
    Attack(INNOCENT, b"1 + 1;\n", ci=True),
    # a. other protocols
    Attack("HTTP: a page posts text", POST, ci=True),
    Attack("HTTP: a page asks for a program", GET),
    Attack("HTTP: a form of several parts", FORM),
    Attack("HTTP: a page posts, byte by byte", _in_pieces(POST)),
    Attack("HTTP: a page posts a thousand times", _again(POST), seconds=5),
    Attack("HTTP/2", HTTP2),
    Attack("WebSocket", SOCKET),
    Attack("TLS", _again(_client_hello(), 0.01)),
    Attack("other greetings", _again(b"SSH-2.0-OpenSSH_9.2\r\n;shutdown;\r\n", 0.01)),
    Attack("a SOCKS client", _again(b"\x05\x01\x00;shutdown;\n", 0.01)),
    # b to f
    *_programs({"a regexp without end": _REGEXPS.pop("a regexp without end")}, ci=True),
    *_programs(_REGEXPS),
    Attack("ten regexps at once", b'Regexp.new("(a+)+$").match("a" * 60 + "b");\n', connections=10),
    Attack("a loop that never gives way", b"loop| {},\n", seconds=6, holds=1, ci=True),
    Attack("six loops that never give way", b"loop| {},\n", connections=6, seconds=6, holds=1),
    Attack(
        "six loops that go on when they are ended", b"loop| { try { loop| {} } catch {} };\n", connections=6, seconds=8,
        holds=1,
    ),  # fmt: skip
    *_programs(_HELD, holds=1),
    *_programs(_HELD_AGAIN, holds=MAX_HOLDS),
    *_programs(_HELD_MEMORY, holds=1),
    *_programs(_HELD_OTHERS, holds=2, spoils=True),  # once by itself, once as the neighbour's value is printed
    *_programs(_BUILT_IN, memory=800.0),
    *_programs(_OTHERS, spoils=True),
    Attack("_exit", b"System._exit(1); _exit(1);\n", ends=True),
    Attack("output without end that nobody reads", b'for| (200000) { echo("x" * 1000) };\n', reads=False, ci=True),
    Attack("output without end, to all", b'for| (20000) { wall("x" * 1000) };\n', reads=False),
    *_programs(_MEMORY),
    *_programs(_TEXTS),
    *_programs(_CROWDS),
    # g and h
    Attack("150 connections, 64 descriptors", _crowd(150), descriptors=64, leaves=True, ci=True),
    Attack("1000 connections", _crowd(1000), leaves=True),
    Attack("answers to those who sent all", _half_closed),
    # and what else is known
    Attack("random bytes", _random, ci=True),
    Attack("words in any order", _word_salad),
    Attack("every byte", bytes(range(256)) * 400, connections=5),
    Attack("zeros", bytes(10_000_000)),
    Attack("a hundred slow senders", _slow),
    Attack("twenty that hardly read", _deaf),
    Attack("resets in the middle of an answer", _resets, ci=True),
    Attack("connections that come and go", _comings),
    Attack("load of what is no program", _loads, seconds=6),
    Attack("frames of a remote that lie", _binary_mode),
    Attack("a remote that takes over", _takes_over),
    *_programs(_OUTSIDE),
    *_sabotages(),
)
"""All rows."""


def find(names: Iterable[str]) -> list[Attack]:
    """The rows with one of these words in their names; all of them for none."""
    words = [name.lower() for name in names]
    return [attack for attack in ATTACKS if not words or any(word in attack.name.lower() for word in words)]


def main() -> None:
    """Attack until killed: NAME PORT FOLDER."""
    name, port, folder = sys.argv[1:]
    (attack,) = (attack for attack in ATTACKS if attack.name == name)
    field = Field(int(port), Path(folder))
    (field.folder / BEGINS).touch()
    if callable(attack.says):
        attack.says(field)
    else:
        play(field, attack.says, attack.connections, attack.reads)


if __name__ == "__main__":
    main()
