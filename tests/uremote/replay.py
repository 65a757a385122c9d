"""Plays what an original remote program said against our server, and compares what it was answered.

A recording is a list of steps: bytes of the remote (R), what a user typed on another connection (U), and the bytes that
the server sent to the remote (S).  Numbers that the server chooses (of objects and of calls) are made those of the
recording, so that every byte of the remote stays what it was.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from urbihw.kernel import Kernel
from urbihw.kernel.runtime.identifiers import UID_BASE, UID_STEP
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.uobject.registry import registry_of

CAPTURES = Path(__file__).parent / "captures"

_ESCAPE = re.compile(r"\\(x[0-9a-fA-F]{2}|.)")
_PLAIN = {"n": "\n", "r": "\r", "t": "\t", "\\": "\\"}


def raw(text: str) -> str:
    """The bytes behind the notation of the recordings, one character each."""
    return _ESCAPE.sub(lambda m: chr(int(m[1][1:], 16)) if m[1][0] == "x" else _PLAIN.get(m[1], m[0]), text)


@dataclass
class Step:
    kind: str
    text: str


def relayed(name: str) -> list[Step]:
    """A recording made through a relay: ``1.23 R: ...``, ``1.23 S: ...``, ``#### other client: ...``."""
    steps = []
    whole = (CAPTURES / name).read_text("latin-1")
    known: set[str] = set()
    for line in whole.splitlines():
        if line.startswith("#### other client: "):
            text = line.removeprefix("#### other client: ")
            steps.append(Step("U", re.sub(r"\.&(\w+)", r'.getSlot("\1")', text)))  # .& came after 2.3
            continue
        match = re.match(r"[\d.]+ ([RS]): (.*)$", line)
        if match is not None and match[2] != "<closed>":
            steps.append(Step(match[1], completed(raw(match[2]), raw(whole), known)))
    return steps


def typed(name: str) -> list[Step]:
    """A recording made by hand: ``R> ...``, ``U> ...``, and what came back."""
    steps = []
    for line in (CAPTURES / name).read_text("latin-1").splitlines():
        match = re.match(r"(?:(R|U)> |  ( *S>| S\(remote\)>|S\(user\)>|S\(remote\)>) ?|(\[\d{8}:__Ext))(.*)$", line)
        if line.startswith(("second Foo", "f.destroy")):
            break
        if match is None:
            continue
        if match[3]:  # the recording does not show what the user typed for this
            called = re.search(r'"(\w+\.\w+)__1", "_\d+", (\d+)\]', match[4])
            assert called is not None
            steps.append(Step("U", f"{called[1]}({called[2]});"))
        if r"\x00\x03_15" in line:  # an answer to a call that is not shown either
            continue
        kind = match[1] or ("S" if match[3] or "user" not in match[2] else "A")
        text = (match[3] or "") + match[4]
        if kind == "U":
            text = re.sub(r"\.&(\w+)", r'.getSlot("\1")', text)
        if kind == "U" and "  => " in text:
            text, _, answer = text.partition("  => ")
            answer = answer.partition("\\n  |")[0].partition("  |")[0]
            steps += [Step("U", raw(text)), Step("A", raw(answer + "\\n") if answer.strip() else "")]
            continue
        steps.append(Step(kind, raw(text)))
    return steps


_CUT = re.compile(r"characters left out|<\d+ (?:lines|pairs) \"")


def completed(text: str, whole: str, seen: set[str]) -> str:
    """The recordings were shortened; what was cut is put back: the handshake is the same for all programs, and what an
    object has is what is used of it later.  ``seen`` are the objects put back so far, for those that come in pieces."""
    if _CUT.search(text) is None:
        return text
    if text[0] in "\x01\x0b\n":
        return _completed_frames(text, whole, seen)
    for head in ("//#push 1003", "//#push 31"):
        if text.startswith(head):
            return next(step.text for step in relayed("remote-machine-text.txt") if step.text.startswith(head))
    objects = list(dict.fromkeys(re.findall(r"external object (\w+)\|", text)))
    if "hasSlot(\"syncGet\")" not in text:
        answers = re.findall(r"Global\.UObject\.funCall\(.*?\),", text)
        return "".join(declared(name, whole) for name in objects) + ";\n" + "".join(answers)
    hook = re.search(r"hookPoint_vm_\d+", text)
    assert hook is not None
    known = next(step.text for step in relayed("remote-machine-text.txt") if "hookPoint = " in step.text)
    known = re.sub(r"hookPoint_vm_\d+", hook[0], known)
    classes = dict.fromkeys(re.findall(r'\[4, "object_\d+", "(\w+)"\]', whole))
    if not classes:  # the same program
        return known
    mode = 'binaryMode(1, "remotecontext_setmode");' if "binaryMode(1" in text else ""
    return known.partition("class UMachine")[0] + "".join(declared(name, whole) for name in classes) + f";;\n{mode}"


def _completed_frames(text: str, whole: str, seen: set[str]) -> str:
    """The same for what was sent in binary mode."""
    found = re.search(r"(object_\d+|uob_vm1)\.", text)
    if found is None or found[1] in seen:
        return ""
    seen.add(found[1])
    chain = declared(found[1], whole)
    if f"class {found[1]}" not in text:  # its beginning was not cut
        chain = chain.partition(f"external object {found[1]}|\n")[2]
    frame = f"\x0b{chr(len(chain) >> 8)}{chr(len(chain) & 255)}{chain}"
    return frame + ("\n\x00\x03_92\x06\x00\x07uob_vm1" if found[1] == "uob_vm1" else "")


def declared(name: str, whole: str) -> str:
    """The declarations of an object, as far as the rest of the recording needs them."""
    functions = dict(re.findall(r'\[0, "object_\d+\.(\w+)__(\d+)"', whole))
    variables = dict.fromkeys(re.findall(r'(?:object_\d+\.getSlot\("|\[1, "object_\d+\.)(\w+)"', whole))
    variables |= dict.fromkeys(re.findall(r"\x01\x00.object_\d+\.(\w+)[\x00-\x07]", whole, re.DOTALL))
    events = dict(re.findall(r'\[2, "object_\d+\.(\w+)__(\d+)"', whole))
    lines = [f"class {name}{{}}|", f"external object {name}|"]
    lines += [f"if (!isdef({name}.{s})) var {name}.{s}|external var {name}.{s} from {name}|" for s in variables]
    lines += [f"try{{var {name}.ev = Event.new()}} catch(var e) {{}}|"]
    lines += [f"external event ({number}) {name}.{slot} from {name}|" for slot, number in events.items()]
    lines += [f"external function ({number}) {name}.{slot} from {name}|" for slot, number in functions.items()]
    return "\n".join(lines)


_OWN: tuple[tuple[re.Pattern[str], str | Callable[[re.Match[str]], str]], ...] = (
    (re.compile(r"\[\d{8,}"), "[T"),
    (re.compile(r'(__version\]) ".*"'), r"\1 VERSION"),
    (re.compile(r'(__ident\]) ".*"'), r"\1 IDENT"),
    (re.compile(r"(URBI_1\]) \[[\d, ]*\]"), r"\1 TIME"),
    (re.compile(r'(\[1, "[\w.]+", .*), [-+.\de]+\]$', re.DOTALL), r"\1, STAMP]"),
    (re.compile(r" \(possible misspelling of \w+\)"), ""),
    (re.compile(r"0x\w+"), "0xADDRADDRADDR"),
    (re.compile(r"!!! (<src>/\S+:)?\d+\.\d+(-\d+)?(\.\d+)?: "), "!!! P: "),
    (re.compile(r"from: \d+\.\d+(-\d+)?: "), "from: P: "),
    (re.compile(r"\d+\.\d{6,}"), lambda match: f"{float(match[0]):g}"),
)
"""What each server says in its own way: times, its version, addresses, positions (line 1 ends with the handshake of
the recording), the newer one's guesses at misspellings, and numbers, of which the original sends six digits."""


def neutral(text: str) -> list[str]:
    """The lines of a server without what is its own."""
    lines = [line for line in re.split(r"\n(?=\[\d{8})|\n\Z", text) if line]
    for pattern, by in _OWN:
        lines = [pattern.sub(by, line) for line in lines]
    return lines


class Replay:
    """Our server, the connection of the recorded remote, and another for the user."""

    def __init__(self) -> None:
        self.kernel = Kernel(SimClock())
        # Addresses as long as the recorded ones.
        self.kernel.world.identifiers.count = (0x100000000000 - UID_BASE) // UID_STEP
        self.registry = registry_of(self.kernel.world)
        self.remote = self.kernel.open_lobby("127.0.0.1")
        self.user = self.kernel.open_lobby("127.0.0.1")
        self.kernel.run()
        self.said = ""

    def play(self, steps: list[Step]) -> tuple[list[str], list[str]]:
        """What the remote was sent in the recording, and what it was sent here; ``said`` is what the user was sent."""
        wanted = got = ""
        self.said = ""
        for index, step in enumerate(steps):
            self._prepare(steps[index:])
            if step.kind == "S":
                wanted += step.text
                continue
            if step.kind == "A":
                continue
            text = step.text.replace("obj_0xADDRADDRADDR", self._unnamed(got))
            (self.remote if step.kind == "R" else self.user).feed(text.encode("latin-1"))
            self.kernel.scheduler.run_simulated(self.kernel.clock.now() + 0.1)
            got += self.remote.output.take_bytes().decode("latin-1")
            self.said += self.user.output.take_bytes().decode("latin-1")
        return neutral(wanted), neutral(got)

    @staticmethod
    def _unnamed(got: str) -> str:
        """The address of our object in the place of the one that the recording hides."""
        found = re.findall(r"obj_0x[0-9a-f]+", got)
        return found[-1] if found else "obj_0xADDRADDRADDR"

    def _prepare(self, rest: list[Step]) -> None:
        """Let the next numbers be those of the recording."""
        made = called = None
        for step in rest:
            if step.kind == "S":
                made = made or re.search(r'\[4, "object_(\d+)"', step.text)
                called = called or re.search(r'\[0, "[\w.]+", "_(\d+)"', step.text)
        if made is not None:
            self.registry._count = int(made[1]) - 1
        if called is not None:
            self.registry.tickets = itertools.count(int(called[1]))
            for connection in self.registry.connections.values():
                connection._tickets = self.registry.tickets
