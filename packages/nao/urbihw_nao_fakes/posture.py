"""ALRobotPosture."""

from __future__ import annotations

from urbihw_nao_fakes.body import POSTURES, Body
from urbihw_nao_fakes.services import Failed, Later, Service, method


class Posture(Service):
    """ALRobotPosture of a body."""

    name = "ALRobotPosture"

    def __init__(self, body: Body) -> None:
        super().__init__()
        self.body = body

    @method("goToPosture", "(sf)", "b")
    def go_to(self, name: str, share: float) -> Later:
        """The answer comes when it is there."""
        if name not in POSTURES:
            raise Failed(f"ALRobotPosture: no posture {name}")
        return Later(self.body.go_to_posture(name, share).ended, True)

    @method("stopMove")
    def stop(self) -> None:
        """Hold all joints where they are."""
        self.body.hold_joints()

    @method("getPosture", "()", "s")
    def get_posture(self) -> str:
        """The one it is in."""
        return self.body.posture_name

    @method("getPostureList", "()", "[s]")
    def get_postures(self) -> list[str]:
        """The names of all postures."""
        return list(POSTURES)
