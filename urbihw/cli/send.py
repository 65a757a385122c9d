"""``urbi-send``: sends commands and files to a server, and shows its output (manual, section 18.6).

Answers go to standard output, errors (``!!!``) to standard error.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence
from typing import BinaryIO

from urbihw.cli.lobby_client import LobbyClient
from urbihw.cli.options import CliRefused, GetoptParser, add_sources, complain, source_bytes
from urbihw.cli.reach import add_server, credentials, server
from urbihw.client.session import Message
from urbihw.exitcodes import INTERRUPTED

PROGRAM = "urbi-send"


def parser() -> GetoptParser:
    """The options of ``urbi-send``."""
    made = GetoptParser(PROGRAM, "Send commands and files to an urbiscript server.", f"{PROGRAM} OPTION... [FILE...]")
    add_sources(made)
    add_server(made)
    made.add_argument("-b", "--banner", action="store_true", help="show the banner, too")
    made.add_argument("-Q", "--quit", action="store_true",
                      help="disconnect once all is run, as if -e 'quit;' came last")
    made.add_argument("files", nargs="*", metavar="FILE", help="as with --file, after all others")
    return made


def main(argv: Sequence[str] | None = None) -> int:
    """The command; returns the exit code."""
    options = parser().parse(argv)
    try:
        texts = [source_bytes(kind, value) for kind, value in options.sources]
        texts += [source_bytes("file", name) for name in options.files]
        with LobbyClient(server(options), credentials(options)) as link:
            greeting = link.read_banner()
            if options.banner:
                for line in greeting:
                    show(line)
            link.send(b"".join(text + b"\n" for text in texts))
            if options.quit:
                link.send(b"quit;\n")
            elif sys.stderr.isatty():
                print(f"{PROGRAM}: sent; hit Ctrl-C to end the connection", file=sys.stderr)
            while (received := link.read()) is not None:
                show(received)
            print("[00000000:client_error] End of file", file=sys.stderr)
    except CliRefused as error:
        return complain(PROGRAM, error)
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:
        # The reader of the pipe has ended; end too, as programs in a pipeline do.
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)
        signal.raise_signal(signal.SIGPIPE)
    return 0


def show(line: Message) -> None:
    """Print a line as it was received."""
    stream: BinaryIO = sys.stderr.buffer if line.is_error else sys.stdout.buffer
    stream.write(line.raw + b"\n")
    stream.flush()


if __name__ == "__main__":
    sys.exit(main())
