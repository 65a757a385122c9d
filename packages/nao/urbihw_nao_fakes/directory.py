"""ServiceDirectory: which services there are, and where; clients may register their own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from urbihw_nao_fakes.connection import Connection
from urbihw_nao_fakes.foreign import Caller, ForeignService, Info, Then
from urbihw_nao_fakes.services import Failed, Service, Signal, method

INFO = "(sIsI[s]s)<ServiceInfo,name,serviceId,machineId,processId,endpoints,sessionId>"
PROCESS = 4242


class Host(Caller, Protocol):
    """The server: its own services by number, and who calls."""

    services: dict[int, Service]
    calling: Connection


class Directory(Service):
    """ServiceDirectory; ``endpoint`` says where the robot is.

    Attributes:
        foreign: the services of clients, by number.
        machine: the identifier of the machine that the robot is.
    """

    name = "ServiceDirectory"

    def __init__(self, host: Host, endpoint: Callable[[], str]) -> None:
        super().__init__()
        self.foreign: dict[int, ForeignService] = {}
        self.machine = "machine"
        self._host, self._endpoint = host, endpoint
        self._last_number = 0

    @method("service", "(s)", INFO)
    def find_service(self, name: str) -> Info:
        """Where one is.  Raises Failed."""
        for info in self.get_services():
            if info.name == name:
                return info
        raise Failed(f"Cannot find service '{name}' in index")

    @method("services", "()", f"[{INFO}]")
    def get_services(self) -> list[Info]:
        """All that can be called."""
        own = [
            Info(service.name, number, self.machine, PROCESS, [self._endpoint()], "0")
            for number, service in sorted(self._host.services.items())
        ]
        return own + [each.info for each in self.foreign.values() if each.ready]

    # ---------------------------------------------------------------- services of clients

    @method("registerService", f"({INFO})", "I")
    def register_service(self, told: tuple[Any, ...]) -> int:
        """A new one, of the client that calls; it can be called after `serviceReady`.  Returns its number."""
        info = Info(*told)
        names = [service.name for service in self._host.services.values()]
        if info.name in [*names, *(each.info.name for each in self.foreign.values())]:
            raise Failed(f"Service '{info.name}' is already registered")
        number = self._last_number = max(self._last_number, *self._host.services) + 1
        self.foreign[number] = ForeignService(info._replace(number=number), self._host.calling, self._host)
        return number

    @method("unregisterService", "(I)")
    def unregister_service(self, number: int) -> None:
        """Only its owner may."""
        self._find_own(number)
        self._remove(number)

    @method("serviceReady", "(I)")
    def set_ready(self, number: int) -> None:
        """It can be called from now on."""
        service = self._find_own(number)
        service.ready = True
        self.emit(self.added, number, service.info.name)

    @method("updateServiceInfo", f"({INFO})")
    def update_service(self, told: tuple[Any, ...]) -> None:
        """It is somewhere else now."""
        info = Info(*told)
        self._find_own(info.number).info = info

    added = Signal("serviceAdded", "(Is)")
    removed = Signal("serviceRemoved", "(Is)")

    @method("machineId", "()", "s")
    def get_machine(self) -> str:
        """The identifier of the machine."""
        return self.machine

    def remove_services_of(self, owner: Connection) -> None:
        """A client is gone, and its services with it."""
        for number in [number for number, each in self.foreign.items() if each.owner is owner]:
            self._remove(number)

    def call_service(self, name: str, method: str, arguments: tuple[Any, ...], then: Then = lambda _: None) -> None:
        """Call a method of a client's service; ``then`` gets the value, or a `Failed`."""
        for each in self.foreign.values():
            if each.info.name == name and each.ready:
                each.call(method, arguments, then)
                return
        then(Failed(f"Cannot find service '{name}' in index"))

    def _find_own(self, number: int) -> ForeignService:
        if number not in self.foreign or self.foreign[number].owner is not self._host.calling:
            raise Failed(f"Can't find service #{number}")
        return self.foreign[number]

    def _remove(self, number: int) -> None:
        service = self.foreign.pop(number)
        if service.ready:
            self.emit(self.removed, number, service.info.name)
