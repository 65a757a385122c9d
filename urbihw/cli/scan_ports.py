"""The search of ``urbihw scan`` for servos on the serial ports of this machine; nothing is printed here.

A port whose adapter belongs to a robot without servos (an NXT, a CAN adapter) is named, and no byte is sent to it.
Nor is one sent to a port that is no USB adapter, unless its url is given: a console or another robot may be there.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Final

from urbihw import platforms
from urbihw.buses.errors import LinkGone, Unavailable
from urbihw.buses.link import Url
from urbihw.buses.ports import SerialPort, latency, serial_ports
from urbihw.buses.servos import units
from urbihw.buses.servos.findings import ServoFinding, cycle_time, findings
from urbihw.buses.servos.line import names_speed
from urbihw.buses.servos.status import FEETECH
from urbihw.buses.servos.survey import BAUDS, Progress, ServoSurvey, SurveyedServo, survey
from urbihw.cli.ports_in_use import open_line
from urbihw.frozen import frozen
from urbihw.started import as_typed

_SERVOS: Final = "servos"
_SHORTEST_LATENCY: Final = 0.001


@frozen(slots=False)
class ScanWish:
    """What is searched for.

    Attributes:
        url: of one port, "" for all.
        bauds: speeds, () for all.
        protocols: 1, 2.
        thorough: ping every id at every speed.
    """

    url: str = ""
    bauds: Sequence[int] = ()
    protocols: Sequence[int] = (1, 2)
    thorough: bool = False


@frozen(slots=False)
class PortReport:
    """What was found on one port.

    Attributes:
        port: its path or url.
        adapter: its name and the robots that it may belong to.
        serial_number, by_id: see ``SerialPort``.
        survey: None if it was not scanned.
        problem: why not, in one line; "" for none.
        latency: seconds for which the adapter keeps answers back.
        usable: False if the port should have been scanned and could not be.
    """

    port: str
    adapter: str = ""
    serial_number: str = ""
    by_id: str = ""
    survey: ServoSurvey | None = None
    problem: str = ""
    latency: float = 0.0
    usable: bool = True


def search(wanted: ScanWish, progress: Progress) -> Iterator[PortReport]:
    """Scan one port or all, one report each, as they are done. Raises BadUrl for a url without sense."""
    ports = serial_ports()
    if wanted.url:
        target = Url.parse(wanted.url).target
        known = next((port for port in ports if target in (port.device, port.by_id)), None)
        yield _scan_port(wanted.url, known, wanted, progress)
        return
    for port in ports:
        reason = _not_for_servos(port)
        yield _report(port, problem=reason) if reason else _scan_port(port.device, port, wanted, progress)


def adapter_name(port: SerialPort) -> str:
    """What a port is: the name that the platforms have for its USB numbers, else what it says of itself."""
    robots: dict[str, list[str]] = {}
    for platform, name, _ in _owners(port):
        robots.setdefault(name, []).append(platform)
    return ", ".join(f"{name} ({', '.join(found)})" for name, found in robots.items()) or port.description


def _owners(port: SerialPort) -> Iterator[tuple[str, str, Sequence[str]]]:
    """Platform, name of the adapter and buses of each platform that knows the USB numbers of a port."""
    for manifest in platforms.manifests():
        for usb in manifest.usb:
            if (usb.vendor, usb.product) == (port.vendor, port.product):
                yield manifest.name, usb.name, manifest.buses


def _not_for_servos(port: SerialPort) -> str:
    """Why a port is not scanned without being named; "" if it is."""
    if port.vendor is None:
        return f"no USB adapter, not scanned; to scan it: {as_typed('urbihw scan')} {port.device}"
    owners = list(_owners(port))
    if owners and not any(_SERVOS in buses for _, _, buses in owners):
        return f"no adapter for servos, not scanned; to scan it: {as_typed('urbihw scan')} {port.device}"
    return ""


def _scan_port(url: str, port: SerialPort | None, wanted: ScanWish, progress: Progress) -> PortReport:
    bauds = tuple(wanted.bauds)
    try:
        if bauds or names_speed(url):
            line = open_line(url, bauds[0] if bauds else None)
        else:
            line = open_line(url, BAUDS[0])
            bauds = BAUDS
        with line:
            if not line.has_speed:
                bauds = (line.baud,)
            found = survey(line, bauds or (line.baud,), wanted.protocols, thorough=wanted.thorough, progress=progress)
            late = latency(Url.parse(url).target)
    except (Unavailable, LinkGone) as error:
        return _report(port, url, problem=str(error), usable=False)
    # An adapter at its shortest time is as fast as it gets.
    return _report(port, url, survey=found, latency=late if late > _SHORTEST_LATENCY else 0.0)


def _report(port: SerialPort | None, url: str = "", **found: Any) -> PortReport:
    if port is None:
        return PortReport(url, **found)
    return PortReport(url or port.device, adapter_name(port), port.serial_number, port.by_id, **found)


def wire_findings(report: PortReport) -> list[ServoFinding]:
    """What is wrong with the line as a whole."""
    found = []
    if report.latency:
        found.append(ServoFinding(
            f"the adapter keeps each answer back for {1000 * report.latency:.0f} ms: install the udev rules "
            "(docs/operations.md), or write 1 to its latency_timer", report.latency,
        ))  # fmt: skip
    for baud, number in report.survey.conflicts if report.survey else ():
        found.append(ServoFinding(
            f"id {number} at {baud} bps: more than one servo answers; "
            f"{as_typed('urbihw servo set-id')} leads through giving one of "
            "them another id"
        ))  # fmt: skip
    servos = report.survey.servos if report.survey else ()
    speeds = {servo.baud for servo in servos}
    if len(told_servos(servos)) < len(servos):
        found.append(ServoFinding(
            f"the same servos answer at {len(speeds)} speeds: this port does not set its speed, so ?baud= tells "
            "nothing (a simulated robot: start it with --follow-baud)"
        ))  # fmt: skip
    elif len(speeds) > 1:
        mending = as_typed("urbihw servo set-baud")
        found.append(ServoFinding(f"servos of several speeds on one line: give all the same ({mending})"))
    return found


def told_servos(servos: Sequence[SurveyedServo]) -> Sequence[SurveyedServo]:
    """The servos, each once: a port that does not set its speed shows the same ones at every speed, and a servo hears
    one speed only."""
    found: dict[int, dict[tuple[int, int], SurveyedServo]] = {}
    for servo in servos:
        found.setdefault(servo.baud, {})[servo.device.id, servo.device.model] = servo
    first, *others = found.values() or ({},)
    return [*first.values()] if others and all(each.keys() == first.keys() for each in others) else servos


def shown(servo: SurveyedServo, item: str) -> float | None:
    """A live value of a servo in SI units, None if it has none."""
    table, raw = servo.device.table, servo.values.get(item)
    return None if table is None or raw is None else units.to_si(table.item(item), raw)


def firmware(servo: SurveyedServo) -> str:
    """The firmware of a servo as people write it: 44, of a Feetech 3.10; "?" if it is not known."""
    number = servo.device.firmware
    if servo.device.protocol == FEETECH:
        return f"{number // 100}.{number % 100}"
    return str(number or "?")


def as_json(reports: Iterable[PortReport]) -> dict[str, Any]:
    """The reports for programs; times in seconds, V, degC."""
    return {"ports": [_port_json(report) for report in reports]}


def _port_json(report: PortReport) -> dict[str, Any]:
    found = report.survey
    return {
        "port": report.port, "adapter": report.adapter, "serial_number": report.serial_number, "by_id": report.by_id,
        "problem": report.problem,
        "bauds": list(found.bauds) if found else [],
        "conflicts": [{"baud": baud, "id": number} for baud, number in found.conflicts] if found else [],
        "findings": _findings_json(wire_findings(report)),
        "servos": [_servo_json(servo, report.latency) for servo in found.servos] if found else [],
    }  # fmt: skip


def _servo_json(servo: SurveyedServo, late: float) -> dict[str, Any]:
    device = servo.device
    return {
        "id": device.id, "baud": servo.baud,
        "protocol": "feetech" if device.protocol == FEETECH else device.protocol, "model": device.name,
        "model_number": device.model, "firmware": firmware(servo),
        "voltage": shown(servo, "present_voltage"), "temperature": shown(servo, "present_temperature"),
        "cycle": cycle_time(servo, late), "findings": _findings_json(findings(servo)),
    }  # fmt: skip


def _findings_json(found: Iterable[ServoFinding]) -> list[dict[str, Any]]:
    return [{"text": finding.text, "cost": finding.cost} for finding in found]


