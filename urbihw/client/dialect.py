"""The statements that the client library sends: text out, no sockets.

``Native`` is for servers with ``lobby.answerValue`` and ``Subscription``; ``Plain`` for any other server of
urbiscript 2, such as the original one: there numbers have six digits, events come without what they carry, and a sample
is one line of ``every``.  Each statement runs in the background, and its answer comes on a channel that was chosen for
it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from urbihw.client.lines import guarded
from urbihw.client.literals import string_literal, written_path

SLOWEST_PLAIN_HZ: Final = 10.0
"""Rate at which a server without ``Subscription`` sends slots of which only changes were wanted."""

HELLO: Final = "[System.time, lobby.hasSlot(\"answerValue\"), Global.hasSlot(\"Subscription\")]"
"""The first question: the time of the server, and what it can."""


def hello_text(channel: str) -> str:
    """The first statement of a connection, which any server understands."""
    return guarded(f'Channel.new("{channel}") << {HELLO}', channel) + ",\n"


class Native:
    """For servers of urbihw.  ``has_short_numbers``: whether answers have six digits only."""

    has_short_numbers = False

    def read(self, channel: str, path: str) -> str:
        """Read a slot; no function is called."""
        return f'lobby.answerSlot("{channel}", {string_literal(path)}),\n'

    def write(self, channel: str, path: str, value: str) -> str:
        """Write a slot; ``value`` is a literal.  The server compiles such a statement once for all numbers."""
        quoted = written_path(path)
        if quoted != path:
            return self.evaluate(channel, f"{quoted} = {value} | nil")
        return f'lobby.answerSet("{channel}", {string_literal(path)}, {value}),\n'

    def write_all(self, channel: str, values: Mapping[str, str]) -> str:
        """Write several slots in one turn; ``values`` are literals by their paths.  The answer tells of each what was
        applied, and which limit acts."""
        paths = ", ".join(map(string_literal, values))
        return f'lobby.answerWrites("{channel}", [{paths}], [{", ".join(values.values())}]),\n'

    def evaluate(self, channel: str, body: str) -> str:
        """Evaluate an expression that was made by this library."""
        return f'lobby.answerValue("{channel}", closure () {{ {body} }}),\n'

    def run(self, channel: str, text: str, tag: str) -> str:
        """Run the text of a user, under a tag if there is one.  If it ends with a comma, the answer comes at once."""
        body = f"{tag and tag + ': '}System.eval({string_literal(text)})"
        return self.begin(channel, body) if text.rstrip().endswith(",") else self.evaluate(channel, body)

    def begin(self, channel: str, body: str) -> str:
        """Run an expression in the background; the answer comes when it has begun."""
        return f'lobby.answerBegun("{channel}", closure () {{ {body} }}),\n'

    def end(self, channel: str) -> str:
        """End the statement that answers on a channel; no answer to this one is wanted."""
        return f'lobby.endStatement("{channel}"),\n'

    def stop(self, channel: str, tag: str) -> str:
        """Stop a tag of this connection, or the robot; an unknown one is an error."""
        return self.evaluate(channel, f"{tag}.stop")

    def estop(self, channel: str) -> str:
        """Begin an emergency stop."""
        return self.evaluate(channel, "robot.estop = true")

    def follow(self, channel: str, stream: str, event: str) -> str:
        """Send an event on the channel ``stream`` from now on."""
        none = string_literal(f"{event} is no event")
        followed = f'lobby.answerEvents("{stream}", _event)'
        return self.evaluate(channel, f"var _event = {event} | if (_event.isA(Event)) {followed} else throw {none}")

    def unfollow(self, channel: str, stream: str) -> str:
        """Send the event no more."""
        return self.evaluate(channel, f'lobby.endAnswers("{stream}")')

    def watch(self, channel: str, stream: str, slots: Sequence[str], hz: float) -> str:
        """Send samples of slots on the channel ``stream``."""
        names = ", ".join(map(string_literal, slots))
        made = f'Subscription.new("{stream}", [{names}], {hz:g})'
        return self.evaluate(channel, f'lobby.setSlot("{stream}", {made}) | nil')

    def watch_binary(self, channel: str, stream: str, slot: str, hz: float) -> str:
        """Send a slot with a Binary on the channel ``stream``, one at a time."""
        made = f'Subscription.binary("{stream}", {string_literal(slot)}, {hz:g})'
        return self.evaluate(channel, f'lobby.setSlot("{stream}", {made}) | nil')

    def ready(self, stream: str) -> str:
        """Ask for the next Binary of a stream."""
        return f"lobby.{stream}.ready,\n"

    def unwatch(self, channel: str, stream: str) -> str:
        """Send the samples no more."""
        return self.evaluate(channel, f'lobby.{stream}.stop | lobby.removeSlot("{stream}") | nil')


class PlainDialect(Native):
    """The statements for servers without extensions of urbihw."""

    has_short_numbers = True

    def read(self, channel: str, path: str) -> str:
        """Read a slot; no function is called."""
        holder, _, name = path.rpartition(".")
        value = f'Channel.new("{channel}") << ["", {written_path(path)}]'
        if name.endswith("]"):
            return guarded(value, channel) + ",\n"
        function = f'{written_path(holder) or "lobby"}.getSlot("{name}").isA(Executable)'
        told = f'Channel.new("{channel}") << ["function", {string_literal(path)}]'
        return guarded(f"if ({function}) {told} else {value}", channel) + ",\n"

    def write(self, channel: str, path: str, value: str) -> str:
        """Write a slot; ``value`` is a literal."""
        return self.evaluate(channel, f"{written_path(path)} = {value}")

    def write_all(self, channel: str, values: Mapping[str, str]) -> str:
        """Write several slots in one turn; this server does not tell what was applied."""
        writes = " | ".join(f"{written_path(path)} = {value}" for path, value in values.items())
        return self.evaluate(channel, f"{writes} | [{', '.join('[nil, nil]' for _ in values)}]")

    def evaluate(self, channel: str, body: str) -> str:
        """Evaluate an expression that was made by this library."""
        made = f'var _result = {{ {body} }}.acceptVoid | var _channel = Channel.new("{channel}")'
        sent = 'if (_result.isVoid) _channel << ["", nil] else _channel << ["", _result]'
        return guarded(f"{made} | {sent}", channel) + ",\n"

    def begin(self, channel: str, body: str) -> str:
        """Run an expression in the background."""
        return self.evaluate(channel, f"detach({{ {body} }}) | nil")

    def end(self, channel: str) -> str:
        """Nothing: this server runs its statements to their end."""
        return ""

    def follow(self, channel: str, stream: str, event: str) -> str:
        """Send an event on the channel ``stream`` from now on, without what it carries."""
        handler = f'{stream}: at ({event}?) Channel.new("{stream}") << [System.time, 0, []],\n'
        return handler + self.evaluate(channel, "nil")

    def unfollow(self, channel: str, stream: str) -> str:
        """Send the event no more."""
        return self.evaluate(channel, f"{stream}.stop")

    def watch(self, channel: str, stream: str, slots: Sequence[str], hz: float) -> str:
        """Send samples of slots on the channel ``stream``; a slot that fails is nil."""
        reads = " | ".join(f"try {{ _v << {written_path(slot)} }} catch {{ _v << nil }}" for slot in slots)
        period = 1 / (hz or SLOWEST_PLAIN_HZ)
        every = f'{stream}: every ({period:g}) {{ var _v = [] | {reads} | Channel.new("{stream}") << _v }},\n'
        return every + self.evaluate(channel, "nil")

    def watch_binary(self, channel: str, stream: str, slot: str, hz: float) -> str:
        """Send a slot with a Binary on the channel ``stream``."""
        every = f'{stream}: every ({1 / hz:g}) Channel.new("{stream}") << {written_path(slot)},\n'
        return every + self.evaluate(channel, "nil")

    def ready(self, stream: str) -> str:
        """Nothing: this server sends all of them."""
        return ""

    def unwatch(self, channel: str, stream: str) -> str:
        """Send the samples no more."""
        return self.evaluate(channel, f"{stream}.stop")


def sent(text: str) -> str:
    """A text as connections send it: a character for each byte of UTF-8."""
    return text.encode("utf-8", "surrogateescape").decode("latin-1")
