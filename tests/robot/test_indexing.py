"""What a Localizer's lazy ``[]`` must not do: make indexing slow for everybody."""

from __future__ import annotations

from urbihw.kernel import Kernel
from urbihw.kernel.sched.clock import SimClock
from urbihw.robot import ROBOT_LIBRARY


def test_a_localizer_does_not_make_indexing_lazy() -> None:
    kernel = Kernel(SimClock(), libraries=(ROBOT_LIBRARY,))
    lobby = kernel.open_lobby()
    text = "var l = Localizer.new(\"led\")|; l[left] = Object.new.addProto(Interface.Led)|; l[left].isA(Interface.Led);"
    assert kernel.run_text(lobby, text) == "[00000000] true\n"
    assert not {"[]", "[]="} & kernel.host.world.lazy_names.known_to(lobby)
