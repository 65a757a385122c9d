"""ALBattery."""

from __future__ import annotations

from urbihw_nao_fakes.body import Body
from urbihw_nao_fakes.services import Service, method


class Battery(Service):
    """ALBattery of a body."""

    name = "ALBattery"

    def __init__(self, body: Body) -> None:
        super().__init__()
        self.body = body

    @method("getBatteryCharge", "()", "i")
    def get_charge(self) -> int:
        """The charge of the battery in percent."""
        return round(self.body.charge * 100)
