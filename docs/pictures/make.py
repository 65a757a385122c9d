"""The picture of README: a dialogue with a simulated robot, beside the angle of its servo meanwhile.

    python docs/pictures/make.py record     # runs urbihw and the simulated robot, and writes session.json
    python docs/pictures/make.py            # draws session.json as session.svg

All that is shown was recorded: what is typed and when, what is answered, and the angle of the simulated body itself,
not what the server says of it.
"""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import textwrap
import time
from html import escape
from pathlib import Path
from typing import Any, Final

HERE: Final = Path(__file__).resolve().parent
SESSION: Final = HERE / "session.json"
PICTURE: Final = HERE / "session.svg"
MOTOR: Final = 6

STEPS: Final = (
    (0.5, "motor6.val = 60deg time:1s;"),
    (2.0, 'at (motor6.val > 0) echo("tick") onleave echo("tack");'),
    (3.0, "swing: motor6.val = 0 sin:1s ampli:40deg,"),
    (5.8, "swing.freeze;"),
    (6.8, "swing.unfreeze;"),
    (8.0, "robot.stop;"),
)
"""Seconds, and what is typed then."""
END: Final = 9.0
SAMPLE_S: Final = 0.02

# ---------------------------------------------------------------- recording


def record() -> dict[str, Any]:
    """Run the server on a simulated robot, type the statements, and give what was typed, answered and measured."""
    from urbihw_fakes.bioloid import Bioloid
    from urbihw_fakes.dynamixel.ax12 import DEGREES
    from urbihw_fakes.endpoint import PtyEndpoint

    kit = Bioloid(servos=(MOTOR,), sensors=(), baud=1_000_000)
    robot = PtyEndpoint(kit)
    robot.start()
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    command = ["-m", "urbihw.cli.main", "serve", "--platform", "bioloid", "--url", robot.url, "--port", str(port)]
    with subprocess.Popen((sys.executable, *command, "--quiet"), stdout=subprocess.DEVNULL) as server:
        try:
            client = _connected(port)

            def angle() -> float:
                kit.tick(robot.clock())
                return (kit.servo(MOTOR).position - 1023 / 2) * DEGREES

            return _play(client, lambda: robot.call(angle))
        finally:
            server.terminate()
            server.wait(10)
            robot.close()


def _connected(port: int) -> socket.socket:
    for _ in range(100):
        try:
            client = socket.create_connection(("127.0.0.1", port))
        except OSError:
            time.sleep(0.1)
            continue
        client.setblocking(False)
        return client
    raise OSError("the server does not start")


def _play(client: socket.socket, angle: Any) -> dict[str, Any]:
    lines: list[dict[str, Any]] = []
    angles: list[list[float]] = []
    steps, rest = list(STEPS), b""
    begin = time.monotonic()
    while (now := time.monotonic() - begin) < END:
        if steps and now >= steps[0][0]:
            _, text = steps.pop(0)
            client.sendall(text.encode() + b"\n")
            lines.append({"time": round(now, 3), "typed": text})
        try:
            rest += client.recv(65536)
        except BlockingIOError:
            pass
        *whole, rest = rest.split(b"\n")
        lines += [{"time": round(now, 3), "answer": line.decode("latin-1").rstrip("\r")} for line in whole]
        angles.append([round(now, 3), round(angle(), 2)])
        time.sleep(SAMPLE_S)
    return {"lines": lines, "angles": angles}


# ---------------------------------------------------------------- drawing

WIDTH, HEIGHT, TERMINAL = 960, 300, 500
MARGIN, LEADING, COLUMNS = 16, 16, 62
LEFT, RIGHT, TOP, BOTTOM = TERMINAL + 58, WIDTH - 18, 40, HEIGHT - 44
MOST: Final = 75.0
"""Degrees at the edges of the plot."""
MONO = 'font-family="ui-monospace,DejaVu Sans Mono,Menlo,Consolas,monospace" font-size="12.5"'
SANS = 'font-family="system-ui,DejaVu Sans,Helvetica,Arial,sans-serif" font-size="12" fill="#57606a"'
TYPED, ANSWER, ERROR, NUMBER = "#ffffff", "#7ee787", "#ffa198", "#79c0ff"


def draw(session: dict[str, Any]) -> str:
    """The picture as SVG."""
    typed = [line["time"] for line in session["lines"] if "typed" in line]
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" role="img">',
        "<title>A dialogue with a simulated servo, and its angle meanwhile</title>",
        f'<rect width="{WIDTH}" height="{HEIGHT}" rx="8" fill="#f6f8fa"/>',
        f'<path d="M8 0H{TERMINAL}V{HEIGHT}H8a8 8 0 0 1-8-8V8a8 8 0 0 1 8-8z" fill="#161b22"/>',
        *_terminal(session["lines"]),
        *_axes(),
        *(_mark(number, when) for number, when in enumerate(typed, 1)),
        _curve(session["angles"]),
        "</svg>",
    ]
    return "\n".join(parts) + "\n"


def _terminal(lines: list[dict[str, Any]]) -> list[str]:
    parts, y, number = [], 26, 0
    for line in lines:
        if "typed" in line:
            number += 1
            parts.append(f'<text x="{MARGIN}" y="{y}" {MONO} fill="{NUMBER}">{number}</text>')
            rows, colour = [line["typed"]], TYPED
        else:
            rows = textwrap.wrap(line["answer"], COLUMNS, subsequent_indent=" " * 11, break_long_words=False)
            colour = ERROR if "!!!" in line["answer"] else ANSWER
        for row in rows:
            parts.append(
                f'<text x="{MARGIN + 18}" y="{y}" {MONO} fill="{colour}" xml:space="preserve">{escape(row)}</text>'
            )
            y += LEADING
    return parts


def _x(when: float) -> float:
    return round(LEFT + (RIGHT - LEFT) * when / END, 1)


def _y(angle: float) -> float:
    return round((TOP + BOTTOM) / 2 - (BOTTOM - TOP) / 2 * angle / MOST, 1)


def _axes() -> list[str]:
    parts = [f'<text x="{LEFT}" y="20" {SANS}>angle of the simulated servo (degrees) over time (s)</text>']
    for angle in (-60, -30, 0, 30, 60):
        y = _y(angle)
        parts.append(f'<path d="M{LEFT} {y}H{RIGHT}" stroke="{"#8c959f" if angle == 0 else "#d0d7de"}"/>')
        parts.append(f'<text x="{LEFT - 8}" y="{y + 4}" text-anchor="end" {SANS}>{angle}</text>')
    for second in range(int(END) + 1):
        parts.append(f'<text x="{_x(second)}" y="{BOTTOM + 18}" text-anchor="middle" {SANS}>{second}</text>')
    return parts


def _mark(number: int, when: float) -> str:
    x = _x(when)
    return (
        f'<path d="M{x} {TOP}V{BOTTOM}" stroke="#0969da" stroke-dasharray="3 3"/>'
        f'<text x="{x + 4}" y="{TOP + 10}" {SANS.replace("#57606a", "#0969da")}>{number}</text>'
    )


def _curve(angles: list[list[float]]) -> str:
    points = " ".join(f"{_x(when)},{_y(angle)}" for when, angle in angles)
    return f'<polyline points="{points}" fill="none" stroke="#cf222e" stroke-width="2" stroke-linejoin="round"/>'


def main() -> None:
    """The command."""
    if sys.argv[1:] == ["record"]:
        SESSION.write_text(json.dumps(record(), separators=(",", ":")).replace('{"time"', '\n{"time"') + "\n", "utf-8")
    PICTURE.write_text(draw(json.loads(SESSION.read_text("utf-8"))), "utf-8")


if __name__ == "__main__":
    main()
