"""Which requests may still move a robot: those that no stop, no release and no loss has overtaken."""

from __future__ import annotations

from collections.abc import Callable, Hashable

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.compiler.linemap import LineMap, MappedCall
from urbihw.kernel.errors import MovementRefused
from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.uobject import owned
from urbihw.kernel.uobject.effector import EffectorDevice
from urbihw.kernel.uobject.motion import Motion, Origin


class Rig:
    """A robot of two devices, 6 and 7, and two clients."""

    def __init__(self) -> None:
        self.kernel = Kernel(SimClock())
        self.first, self.second = self.kernel.open_lobby(), self.kernel.open_lobby()
        self.released: list[tuple[Hashable, ...]] = []
        self.motion = Motion(self.kernel.host, "toy", lambda devices, reason: self.released.append(devices))

    def write(self, lobby: Lobby, device: Hashable = 6) -> Origin:
        """The origin of a write by a statement of a client."""
        origins: list[Origin] = []
        self.kernel.scheduler.spawn(lambda: origins.append(self.motion.admit(device)), context=lobby)
        self.kernel.run()
        (origin,) = origins
        return origin

    def error(self, lobby: Lobby, device: Hashable) -> str:
        """Why a statement of a client may not write, "" if it may."""
        found: list[str] = []

        def write() -> None:
            try:
                self.motion.admit(device)
            except MovementRefused as error:
                found.append(error.message)

        self.kernel.scheduler.spawn(write, context=lobby)
        self.kernel.run()
        return "".join(found)

    def say(self, lobby: Lobby, text: str) -> None:
        """Let a client run a statement."""
        self.kernel.feed(lobby, text.encode())
        self.kernel.run()


def test_a_device_that_was_lost_is_moved_by_later_requests_only() -> None:
    rig = Rig()
    before, other = rig.write(rig.first, 6), rig.write(rig.first, 7)
    assert rig.motion.is_live(before, 6) and rig.motion.is_live(other, 7)
    rig.motion.end(6, "it was lost")
    assert not rig.motion.is_live(before, 6)
    assert rig.motion.is_live(other, 7)
    assert rig.motion.is_live(rig.write(rig.first, 6), 6)


def test_a_client_that_releases_its_devices_moves_them_by_later_requests_only() -> None:
    rig = Rig()
    mine, other = rig.write(rig.first, 6), rig.write(rig.second, 7)
    rig.say(rig.first, "lobby.releaseDevices;")
    assert rig.released == [(6,)]
    assert not rig.motion.is_live(mine, 6)
    assert rig.motion.is_live(other, 7)
    assert rig.motion.is_live(rig.write(rig.first, 6), 6)


def test_a_client_that_has_gone_moves_nothing_unless_its_movements_are_kept() -> None:
    for keep in (False, True):
        rig = Rig()
        rig.motion.keep = keep
        mine = rig.write(rig.first)
        rig.first.close()
        rig.kernel.run()
        assert rig.motion.is_live(mine, 6) is keep
        assert rig.released == ([] if keep else [(6,)])


def test_a_stop_and_an_emergency_stop_end_what_was_asked_for_before() -> None:
    rig = Rig()
    before = rig.write(rig.first)
    rig.motion.advance("a test")
    assert not rig.motion.is_live(before, 6)
    after = rig.write(rig.first)
    assert rig.motion.is_live(after, 6)
    rig.motion.latched = "the red button"
    assert not rig.motion.is_live(after, 6)


def refusals(rig: Rig, device: Hashable, lobby: Lobby, meanwhile: Callable[[], None]) -> list[str]:
    """The errors of a statement that writes twice, and of a child that it makes; ``meanwhile`` is between the two."""
    scheduler = rig.kernel.scheduler
    said: list[str] = []

    def write() -> None:
        try:
            rig.motion.admit(device)
        except MovementRefused as error:
            said.append(error.message)

    def statement() -> None:
        write()
        scheduler.sleep(1.0)
        write()
        scheduler.start_now(scheduler.spawn(write, parent=scheduler.running()))

    scheduler.spawn(statement, context=lobby)
    now = rig.kernel.clock.now()
    scheduler.run_simulated(now + 0.5)
    assert said == []
    meanwhile()
    scheduler.run_simulated(now + 2.0)
    return said


def test_a_statement_that_began_before_a_stop_moves_nothing_nor_do_its_children() -> None:
    rig = Rig()
    said = refusals(rig, 6, rig.first, lambda: rig.motion.advance("a test", 5))
    assert len(said) == 2
    assert all(each.endswith("toy was stopped after this statement had begun: a test") for each in said)
    # The answer of the worker to the same stop is no second one.
    assert refusals(rig, 6, rig.first, lambda: rig.motion.advance("a test", 5)) == []


def test_a_statement_that_began_before_a_release_moves_nothing() -> None:
    rig = Rig()
    assert len(refusals(rig, 6, rig.first, lambda: rig.say(rig.first, "lobby.releaseDevices;"))) == 2
    assert refusals(Rig(), 6, rig.second, lambda: None) == []


def test_a_statement_that_began_before_the_loss_of_a_device_does_not_move_it() -> None:
    rig = Rig()
    assert len(refusals(rig, 6, rig.first, lambda: rig.motion.end(6, "it was lost"))) == 2
    rig = Rig()
    assert refusals(rig, 7, rig.first, lambda: rig.motion.end(6, "it was lost")) == []


def test_what_holds_refuses_until_it_is_released() -> None:
    rig = Rig()
    rig.motion.latched = "the red button"
    assert "held by an emergency stop (the red button)" in rig.error(rig.first, 6)
    rig.motion.latched = ""
    rig.motion.held = {6: "limits.motor6.temperature"}
    assert rig.error(rig.first, 6).endswith("6 is held by limits.motor6.temperature")
    assert rig.error(rig.first, 7) == ""


def test_a_client_that_cannot_send_a_stop_any_more_moves_nothing_nor_do_the_lobbies_that_it_opened() -> None:
    rig = Rig()
    rig.second.set_maker(rig.first)
    mine = rig.write(rig.second, 7)
    rig.first.revoke_command()
    for lobby in (rig.first, rig.second):
        assert "is closed on its side" in rig.error(lobby, 6)
    assert not rig.motion.is_live(mine, 7)
    rig.first.close()
    rig.kernel.run()
    assert not rig.second.connected


class GuardedMotor(EffectorDevice):
    """A motor without a worker."""

    val = owned(0.0)

    def init(self, motion: Motion) -> None:
        """Guard the target."""
        self.guard(motion, 6, self.val)


def test_the_place_of_a_write_is_looked_up_only_when_somebody_asks(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig()
    looked_up: list[int] = []
    frames = LineMap.frames

    def counted(self: LineMap, index: int, bounces: bool = False) -> list[MappedCall]:
        looked_up.append(index)
        return frames(self, index, bounces)

    monkeypatch.setattr(LineMap, "frames", counted)
    rig.kernel.host.create(GuardedMotor, "motor6", rig.motion)
    rig.say(rig.first, "function Global.move(x) { motor6.val = x }|;")
    for turn in range(3):  # from the third one on, the text is not parsed any more
        rig.say(rig.first, f"\nmove(0.{turn})|;")
    assert not looked_up
    rig.say(rig.second, "motor6.val = 0.5|;   move(1)|;")
    rig.say(rig.first, "motor6.why;")
    assert b"Lobby_2, at 1.22-28, " in rig.first.output.take_bytes()
