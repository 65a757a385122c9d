"""Robots that are joined in a fleet: list, watch, call, stop all."""

from __future__ import annotations

import argparse
import asyncio
import json
import logging
import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from urbihw.backoff import BackOff
from urbihw.cli.options import CliRefused, complain, number
from urbihw.cli.reach import add_access, credentials, resolve_server
from urbihw.exitcodes import EX_CONFIG, EX_OK, EX_UNAVAILABLE
from urbihw.extras import install_command
from urbihw.fleets.names import ALL, DEFAULT_ENDPOINT, checked_endpoint, checked_fleet_name
from urbihw.started import as_typed

if TYPE_CHECKING:
    from urbihw.fleets.line import FleetLine
    from urbihw.fleets.settings import FleetSettings

WATCH_TIMEOUT_S: Final = 5.0
RETRY_S: Final = 0.5
MAX_PAUSE_S: Final = 5.0
STOPPED: Final = {"estop": "stopped, held until: {release}", "release": "released"}
WORDS: Final = (
    "ls | watch [ROBOT [SLOT ...]] | call ROBOT FUNCTION [ARGUMENT ...] | read ROBOT SLOT | write ROBOT SLOT NUMBER | "
    "stop [ROBOT] | release [ROBOT]"
)


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw fleet``."""
    parser.add_argument("words", nargs="+", metavar="WHAT", help=WORDS)
    parser.add_argument("--fleet", default="", metavar="NAME", help="the fleet (default: the only one)")
    parser.add_argument("--name", default="", help="who asks, for rights and for the log (default: the user)")
    parser.add_argument("--endpoint", default=DEFAULT_ENDPOINT, help="where the fleet meets (%(default)s)")
    parser.add_argument("--timeout", type=number(0.1, 60, "time-out in s"), default=WATCH_TIMEOUT_S, metavar="S",
                        help="for an answer (%(default)s)")
    parser.add_argument("--json", action="store_true", help="for programs")
    bridge = parser.add_argument_group("of the bridge of a robot, which its daemon starts")
    bridge.add_argument("--child", action="store_true", help="end when standard input ends")
    bridge.add_argument("--control", type=Path, metavar="PATH", help="control socket of the robot")
    bridge.add_argument("--platform", default="", metavar="NAME", help="platform of the robot")
    bridge.add_argument("--hz", type=number(0.1, 100, "rate in Hz"), default=10.0, help="rate of values (%(default)s)")
    bridge.add_argument("--drive", action="append", default=[], metavar="NAME", help="who may drive it from elsewhere")
    bridge.add_argument("--dead-man", type=number(0.2, 10, "time in s"), default=0.5, metavar="S",
                        help="silence after which those lose what they move (%(default)s)")
    add_access(bridge)


def run(options: argparse.Namespace) -> int:
    """Ask the fleet, or serve a robot to it; returns the exit code."""
    from urbihw.fleets.names import BadEndpoint, BadFleetName

    try:
        checked_endpoint(options.endpoint)
        for name in filter(None, (options.fleet, options.name)):
            checked_fleet_name(name)
        verb, *words = options.words
        if verb == "bridge" and len(words) == 1:
            return _serve(options, words[0])
        if verb not in VERBS:
            raise CliRefused(f"there is no {verb!r}; give one of: {WORDS}", EX_CONFIG)
        return _ask(options, verb, words)
    except CliRefused as error:
        return complain("urbihw fleet", error)
    except (BadEndpoint, BadFleetName) as error:
        return complain("urbihw fleet", CliRefused(str(error), EX_CONFIG))
    except ImportError as error:
        if error.name != "zenoh":
            raise
        return complain("urbihw fleet", CliRefused(f"this needs a package: {install_command('fleet')}", EX_CONFIG))


# ---------------------------------------------------------------- the bridge of a robot


def _serve(options: argparse.Namespace, server: str) -> int:
    from urbihw.fleets.bridge import NameTaken

    logging.basicConfig(format="urbihw: %(message)s", level=logging.INFO)
    settings = _settings(options, server)

    async def work() -> None:
        from urbihw.daemon.kept_work import run_until_told

        await run_until_told(_run(settings), ends_with_input=options.child)

    try:
        asyncio.run(work())
    except NameTaken as error:
        raise CliRefused(str(error), EX_CONFIG) from error
    return EX_OK


async def _run(settings: FleetSettings) -> None:
    """Join the robot to the fleet, then show the fleet to its programs.  Raises NameTaken."""
    from urbihw.fleets.bridge import FleetBridge
    from urbihw.fleets.line import FleetLine
    from urbihw.fleets.meeting import NoMeeting
    from urbihw.fleets.script import FleetScript
    from urbihw.fleets.served import ServedRobot

    robot = ServedRobot(settings)
    bridge = FleetBridge(settings, robot)

    async def show() -> None:
        await bridge.here.wait()
        pauses = BackOff(RETRY_S, MAX_PAUSE_S)
        while True:
            try:
                line = FleetLine(settings.fleet, settings.name, settings.endpoint)
                script = FleetScript(robot.connect, line)
                line.is_alive = script.is_alive
                await script.run()
            except NoMeeting:  # the router has just died
                pass
            except Exception:  # the robot must go on to hear stops
                logging.getLogger("urbihw.fleets").exception("our bug in what programs see of the fleet")
            await asyncio.sleep(pauses.next_pause())

    await asyncio.gather(bridge.run(), show())


def _settings(options: argparse.Namespace, server: str) -> FleetSettings:
    from urbihw.cli.console import address
    from urbihw.fleets.settings import FleetSettings

    if options.control is None or not options.fleet or not options.name:
        raise CliRefused("a bridge wants --control, --fleet and --name", EX_CONFIG)
    host, port = address(server)
    return FleetSettings(
        options.fleet, options.name, resolve_server(host, port, options.tls), credentials(options), options.control,
        options.endpoint, options.platform, options.hz, tuple(options.drive), options.dead_man,
    )  # fmt: skip


# ---------------------------------------------------------------- questions to the fleet


def _ask(options: argparse.Namespace, verb: str, words: list[str]) -> int:
    from urbihw.fleets.line import FleetError, FleetLine
    from urbihw.fleets.meeting import NoMeeting

    try:
        with FleetLine(options.fleet, options.name, options.endpoint) as line:
            return VERBS[verb](line, options, words)
    except NoMeeting as error:
        hint = as_typed("urbihw serve --fleet NAME")
        raise CliRefused(f"{error}; a robot joins by {hint}, or fleet = \"NAME\" in its settings") from error
    except FleetError as error:
        raise CliRefused(str(error)) from error
    except KeyboardInterrupt:
        return EX_OK


def _list(line: FleetLine, options: argparse.Namespace, words: list[str]) -> int:
    from urbihw.fleets.line import FleetError

    _want(words, 0, 0)
    rows = []
    for name in line.robots():
        try:
            rows.append({"name": name, **line.info(name), **line.state(name)})
        except FleetError as error:
            rows.append({"name": name, "verdict": "bad", "reasons": [str(error)]})
    if options.json:
        print(json.dumps(rows))
    for row in [] if options.json else rows:
        print(_row(row))
    return EX_OK


def _row(row: Mapping[str, Any]) -> str:
    battery = f", battery {row['battery']:.1f} V" if row.get("battery") else ""
    held = f", held by {row['estop']}" if row.get("estop") else ""
    drivers = f", driven by {', '.join(row['drivers'])}" if row.get("drivers") else ""
    why = f": {'; '.join(row['reasons'][:3])}" if row.get("reasons") else ""
    about = f"{row.get('platform') or '?'} on {row.get('host') or '?'}, urbihw {row.get('version') or '?'}"
    return f"{row['name']}  {row['verdict']}{why}{battery}{held}{drivers}  ({about})"


def _watch(line: FleetLine, options: argparse.Namespace, words: list[str]) -> int:
    robot, slots = (words[0] if words else ALL), words[1:]
    if robot != ALL:
        checked_fleet_name(robot)
    for name, told in line.watch(robot, options.timeout):
        values = {slot: value for slot, value in told["v"].items() if not slots or slot in slots}
        if options.json:
            print(json.dumps({"robot": name, "t": told["t"], "v": values}), flush=True)
        else:
            print(f"{name}  " + "  ".join(f"{slot} {_shown(value)}" for slot, value in values.items()), flush=True)
    raise CliRefused(f"no values came for {options.timeout:g} s; is the robot there ({as_typed('urbihw fleet ls')})?")


def _shown(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _call(line: FleetLine, options: argparse.Namespace, words: list[str]) -> int:
    _want(words, 2)
    robot, function, *args = words
    value = line.call(robot, function, *map(_argument, args), timeout=options.timeout)
    if value is not None:
        print(json.dumps(value) if options.json else _shown(value))
    return EX_OK


def _read(line: FleetLine, options: argparse.Namespace, words: list[str]) -> int:
    _want(words, 2, 2)
    value = line.read(words[0], words[1], options.timeout)
    print(json.dumps(value) if options.json else _shown(value))
    return EX_OK


def _write(line: FleetLine, options: argparse.Namespace, words: list[str]) -> int:
    _want(words, 3, 3)
    told = line.write(words[0], {words[1]: _argument(words[2])}, options.timeout)
    print(json.dumps(told) if options.json else f"{words[1]} {_shown(told.get(words[1]))}")
    return EX_OK


def _stop(verb: str, line: FleetLine, options: argparse.Namespace, words: list[str]) -> int:
    _want(words, 0, 1)
    robot = checked_fleet_name(words[0]) if words else ALL
    told = line.stop(verb, robot)
    outcome = STOPPED[verb].format(release=as_typed("urbihw fleet release"))
    if options.json:
        print(json.dumps({"confirmed": told.confirmed, "failed": told.failed}))
    else:
        for name, seconds in told.confirmed.items():
            print(f"{name}  {1000 * seconds:.1f} ms  {outcome}")
        for name, why in told.failed.items():
            print(f"{name}  NOT {outcome.partition(',')[0]}: {why}", file=sys.stderr)
        if not told.confirmed and not told.failed:
            print("no robot is there", file=sys.stderr)
    return EX_OK if told.confirmed and not told.failed else EX_UNAVAILABLE


def _argument(text: str) -> Any:
    """A number, true or false, or the text as it is."""
    try:
        return json.loads(text)
    except ValueError:
        return text


def _want(words: list[str], least: int, most: int = 100) -> None:
    if not least <= len(words) <= most:
        raise CliRefused(f"give one of: {WORDS}", EX_CONFIG)


VERBS: Final[Mapping[str, Callable[[FleetLine, argparse.Namespace, list[str]], int]]] = {
    "ls": _list, "watch": _watch, "call": _call, "read": _read, "write": _write,
    "stop": partial(_stop, "estop"), "release": partial(_stop, "release"),
}  # fmt: skip
