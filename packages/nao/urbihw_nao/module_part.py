"""Modules that programs offer to NAOqi (``ALModule`` of urbiscript): registered, and calls to them passed on.

Requests: "serve" of a module (device) with (description, methods, whether the robot had it before), each method as a
``BoundMethod``; "withdraw" of a module; "answer" of a call (device: its number) with (whether it went well, value or
error).

Each call comes as a ``DeviceReport`` of (MODULE, CALL) with (number, module, method, arguments); when its caller does
not wait any more, as one of (MODULE, CANCEL) with the number.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Final

from urbihw.buses.errors import BadValue, Unavailable
from urbihw.buses.listening import BusListener
from urbihw.buses.messages import DeviceReport, FromWorker, Refused, Reply, Request
from urbihw.frozen import frozen
from urbihw_nao.exchange import NaoExchange
from urbihw_nao.http_visitor import HttpVisitor, find_allowed_hosts
from urbihw_nao.module_help import standard_methods
from urbihw_nao.part import NaoPart
from urbihw_nao.qimessaging.call_limits import TokenBucket
from urbihw_nao.qimessaging.hosting import Hosting
from urbihw_nao.qimessaging.serving import IncomingCall, ServedMethod

MODULE: Final = "module"
CALL, CANCEL = "call", "cancel"
HTTP_RETRY_S: Final = 5.0
"""Seconds until a port for HTTP that is taken is tried again."""
MODULE_CALLS_A_SECOND: Final = 200.0
"""Calls of all callers together that are passed on, on average: each costs the interpreter of all programs time."""
MODULE_CALL_BURST: Final = 64
"""Calls of all callers together at once, after a pause."""


@frozen
class BoundMethod:
    """A method as ``bindUrbiMethod`` declares it: parameters with their texts, name and text of the result."""

    name: str
    description: str
    parameters: tuple[tuple[str, str], ...] = ()
    result: tuple[str, str] = ("", "")


class ModulePart(NaoPart):
    """See the head of this file."""

    verbs = frozenset({"serve", "withdraw", "answer"})

    def __init__(self, exchange: NaoExchange, hosting: Hosting) -> None:
        super().__init__(exchange)
        self._hosting = hosting
        self._modules: dict[str, dict[str, ServedMethod]] = {}
        self._calls: dict[int, IncomingCall] = {}
        self._count = 0
        self._rate: TokenBucket
        self._http: BusListener | None = None
        self._http_retry_at = 0.0

    # ---------------------------------------------------------------- the link

    def begin(self) -> None:
        self._rate = TokenBucket(MODULE_CALLS_A_SECOND, MODULE_CALL_BURST, self.exchange.now())

    def end(self) -> None:
        """See ``Part``: all callers are gone."""
        self._calls.clear()
        self._close_http()

    def read(self) -> None:
        """See ``Part``: handle what callers have sent."""
        now = self.exchange.now()
        self._hosting.poll(now)
        if self._http is not None:
            self._http.poll(now)
        elif self._modules and self.exchange.options.module_http_port and now >= self._http_retry_at:
            self._open_http(now)

    # ---------------------------------------------------------------- requests

    def request(self, message: Request) -> list[FromWorker]:
        match message.verb:
            case "serve":
                self._serve(message)
                return []
            case "withdraw":
                self._withdraw(str(message.device))
            case _:
                self._answer(message.device, *message.value)
        return [Reply(message.reply_id, True)]

    def _serve(self, message: Request) -> None:
        name = str(message.device)
        description, bound, again = message.value
        own = [self._make_method(name, each) for each in bound]
        methods = [*standard_methods(name, description, own), *own]

        def registered(problem: str) -> None:
            if problem:
                self._modules.pop(name, None)
                self._close_unused_http()
            self.exchange.news.append(Reply(message.reply_id, not problem, error=problem))

        self._modules[name] = {each.name: each for each in methods if each in own or each.name in ("version", "ping")}
        self._hosting.serve_object(name, methods, description, registered, insist=again)

    def _withdraw(self, name: str) -> None:
        self._modules.pop(name, None)
        self._close_unused_http()
        self._hosting.withdraw_object(name)

    def _make_method(self, module: str, bound: BoundMethod) -> ServedMethod:
        name, text = bound.result
        return ServedMethod(
            bound.name,
            partial(self._pass_on, module, bound.name),
            parameters=f"({'m' * len(bound.parameters)})",
            description=bound.description,
            parameter_texts=bound.parameters,
            result_text=": ".join(filter(None, (name, text))),
        )

    # ---------------------------------------------------------------- calls

    def _pass_on(self, module: str, method: str, call: IncomingCall) -> None:
        if not self._rate.take(self.exchange.now()):
            raise BadValue(f"more than {MODULE_CALLS_A_SECOND:g} calls a second, of all callers together")
        self._count += 1
        number = self._count
        self._calls[number] = call

        def cancelled() -> None:
            self._calls.pop(number, None)
            self.exchange.news.append(DeviceReport(MODULE, CANCEL, number))

        call.cancelled = cancelled
        self.exchange.news.append(DeviceReport(MODULE, CALL, (number, module, method, list(call.arguments))))

    def _answer(self, number: int, good: bool, value: Any) -> None:
        call = self._calls.pop(number, None)
        if call is None:
            return
        if good:
            call.answer(value)
        else:
            call.fail(str(value))

    # ---------------------------------------------------------------- HTTP

    def _open_http(self, now: float) -> None:
        options = self.exchange.options
        host, port = options.module_http_host, options.module_http_port
        server = self._hosting.server

        def ask(
            visitor: HttpVisitor, module: str, method: str, arguments: Sequence[Any], then: Callable[[Any, str], None]
        ) -> bool:
            found = self._modules.get(module, {}).get(method)
            if found is not None:
                if len(found.parameters) - 2 != len(arguments):
                    then(None, f"{method}: {len(arguments)} arguments, {len(found.parameters) - 2} expected")
                else:
                    server.start_call(visitor, found, arguments, then, number=0)
            return found is not None

        def welcome(now: float, address: str) -> HttpVisitor:
            hosts = find_allowed_hosts(host, port)
            guard = self._hosting.guard
            return HttpVisitor(now, address, hosts, ask, server.drop_caller, guard, options.login())

        try:
            self._http = BusListener(host, port, welcome)
        except Unavailable as error:
            self._http_retry_at = now + HTTP_RETRY_S
            self.exchange.news.append(Refused("options", "module_http_port", str(error)))

    def _close_unused_http(self) -> None:
        if not self._modules:
            self._close_http()

    def _close_http(self) -> None:
        listener, self._http = self._http, None
        if listener is not None:
            listener.close()
