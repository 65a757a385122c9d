"""``urbi-sound``: records the sound of a device of a server, to save or to play it.

The manual names the program without describing it; host, port, device and output are those of ``urbi-image``.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from urbihw.cli.lobby_client import LobbyClient
from urbihw.cli.options import CliRefused, GetoptParser, complain, number
from urbihw.cli.reach import add_server, credentials, server
from urbihw.cli.sounds import SoundFile, wave_file
from urbihw.exitcodes import EX_CONFIG, INTERRUPTED

PROGRAM: Final = "urbi-sound"
TIMEOUT_S: Final = 10.0
PLAYERS: Final = (("aplay", "-q", "-"), ("pw-cat", "-p", "-"), ("play", "-q", "-t", "wav", "-"))
"""Programs that play a WAVE file from their standard input; the first one that is installed is used."""


def parser() -> GetoptParser:
    """The options of ``urbi-sound``."""
    made = GetoptParser(PROGRAM, "Record sound from an urbiscript server, to save it (--output) or to play it.")
    add_server(made)
    made.add_argument("-d", "--device", default="micro", help="record DEVICE.val (%(default)s)")
    made.add_argument("-t", "--duration", type=number(0.001, 3600, "number of seconds"), default=5.0, metavar="S",
                      help="record S seconds (%(default)s)")
    made.add_argument("-o", "--output", type=Path, metavar="FILE", help="save the sound to FILE, as WAVE")
    return made


def main(argv: Sequence[str] | None = None) -> int:
    """The command; returns the exit code."""
    options = parser().parse(argv)
    try:
        player = None if options.output is not None else find_player()
        with LobbyClient(server(options), credentials(options)) as link:
            data = wave_file(recorded(link, options.device, options.duration))
        if player is not None:
            subprocess.run(player, input=data, check=False)
            return 0
        try:
            options.output.write_bytes(data)
        except OSError as error:
            raise CliRefused(f"cannot write {options.output}: {error.strerror}", EX_CONFIG) from error
        print(f"{options.output}: {len(data)} bytes")
    except CliRefused as error:
        return complain(PROGRAM, error)
    except KeyboardInterrupt:
        return INTERRUPTED
    return 0


def find_player() -> Sequence[str]:
    """The command of a program that plays sound.  Raises CliRefused."""
    for player in PLAYERS:
        if shutil.which(player[0]) is not None:
            return player
    raise CliRefused(f"no program to play sound with ({', '.join(row[0] for row in PLAYERS)}); save it: --output FILE",
                     EX_CONFIG)


def recorded(link: LobbyClient, device: str, duration: float) -> Iterator[SoundFile]:
    """Yield pieces of sound until their total is ``duration`` seconds; each continues where the previous one ended."""
    left = duration
    for line in link.follow(f"at ({device}.val->changed?) answers << {device}.val", TIMEOUT_S):
        if not line.binaries:
            raise CliRefused(
                f"the server answered {line.shown[:60]!r}, which is no sound; which device is it (--device)?"
            )
        sound = SoundFile.of(line.binaries[0])
        if sound.samples:
            left -= sound.format.seconds(len(sound.samples))
            yield sound
        if left <= 1e-9:
            return


if __name__ == "__main__":
    sys.exit(main())
