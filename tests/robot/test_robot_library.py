"""The classes of robots are a library of their own: the language is whole without them."""

from __future__ import annotations

from urbihw.kernel import Kernel
from urbihw.robot import ROBOT_LIBRARY

OF_ROBOTS = [
    "Component", "Figure", "Interface", "Localization", "Localizer", "Mobility", "MobilityWay", "StructureEntry",
    "Subscription",
]  # fmt: skip


def test_the_language_alone_has_no_robots() -> None:
    language, robots = (Kernel(fast=True, libraries=chosen).world for chosen in ((), (ROBOT_LIBRARY,)))
    assert sorted({*robots.global_.slots} - {*language.global_.slots}) == OF_ROBOTS


def test_what_an_interface_says_of_a_slot_holds_for_its_devices() -> None:
    kernel = Kernel(fast=True, libraries=(ROBOT_LIBRARY,))
    lobby = kernel.open_lobby()
    kernel.run_text(lobby, "class Lamp { var val = 0 }|; Lamp.addProto(Interface.Led)|; var Global.lamp = Lamp.new|;")
    assert kernel.run_text(lobby, "lamp->unit; Interface.Battery.voltage->unit;").endswith('"V"\n')
    said = kernel.run_text(lobby, 'System.documentation(lamp, "val"); System.documentation(Interface.Led, "val");')
    first, second = (line.partition("] ")[2] for line in said.splitlines())
    assert first == second != '""'
