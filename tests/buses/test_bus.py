"""Questions and answers over a fake kit, in simulated time."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import pytest

from urbihw.buses.errors import BadFrame, BusTimeout, DeviceRefused
from urbihw.buses.servos import packet, tables
from urbihw.buses.servos.bus import ServoBus
from urbihw.buses.servos.scan import scan
from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.dynamixel.ax12 import Ax12
from urbihw_fakes.dynamixel.axs1 import AxS1
from urbihw_fakes.dynamixel.xseries import XSeries

from .conftest import Rig, both_back_ends, instruction_of


@both_back_ends
def test_read_write_and_refusal(rig: Rig) -> None:
    bus = rig.bus()
    bus.write(6, 25, b"\x01")
    assert bus.read(6, 25, 1) == b"\x01"
    assert bus.read(6, 0, 3)[:2] == b"\x0c\x00"
    with pytest.raises(DeviceRefused, match="device 6 refused: range"):
        bus.write(6, 24, b"\x07")


@both_back_ends
def test_reading_takes_wire_time_and_nothing_else(rig: Rig) -> None:
    start = rig.clock.now()
    rig.bus().read(6, 36, 8)
    assert rig.clock.now() - start == pytest.approx(22 * 10e-6)


@both_back_ends
def test_nothing_is_waited_for_behind_the_answer_on_a_clock_that_goes_on(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = rig.clock.now

    def ticking() -> float:
        rig.clock.sleep_until(told() + 1e-6)
        return told()

    bus = rig.bus()
    monkeypatch.setattr(rig.clock, "now", ticking)
    for errand in (lambda: bus.ping(6), lambda: bus.read(6, 36, 8), lambda: bus.write(6, 25, b"\x01")):
        start = told()
        errand()
        assert told() - start < 0.001


@both_back_ends
def test_a_damaged_answer_is_asked_for_again(rig: Rig) -> None:
    rig.kit.faults.start("checksum", 6, times=1)
    bus = rig.bus()
    assert len(bus.read(6, 36, 8)) == 8
    assert (bus.counters.damaged, bus.counters.retried) == (1, 1)


@both_back_ends
@pytest.mark.parametrize(("fault", "error"), [("silence", BusTimeout), ("checksum", BadFrame), ("cut", BadFrame)])
def test_a_lasting_fault_is_an_error_that_names_the_device(rig: Rig, fault: str, error: type[Exception]) -> None:
    rig.kit.faults.start(fault, 6)
    bus = rig.bus()
    with pytest.raises(error, match="device 6"):
        bus.read(6, 36, 8)
    assert len(bus.read(7, 36, 8)) == 8


@both_back_ends
@pytest.mark.parametrize(("fault", "error"), [("silence", BusTimeout), ("checksum", BadFrame), ("cut", BadFrame)])
def test_a_lasting_fault_in_protocol_2(x_rig: Rig, fault: str, error: type[Exception]) -> None:
    x_rig.kit.faults.start(fault, 6)
    bus = x_rig.bus(2)
    with pytest.raises(error, match="device 6"):
        bus.read(6, 132, 4)
    assert len(bus.read(7, 132, 4)) == 4


@both_back_ends
def test_noise_in_front_of_an_answer_does_no_harm(rig: Rig) -> None:
    rig.kit.faults.start("noise", 6)
    assert rig.bus().read(6, 0, 1) == b"\x0c"


@both_back_ends
def test_a_late_answer_is_never_taken_for_another_and_teaches_patience(rig: Rig) -> None:
    bus = rig.bus()
    rig.kit.faults.start("late", 6, amount=0.021)
    with pytest.raises(BusTimeout):
        bus.read(6, 36, 8, retries=0)
    assert bus.read(7, 3, 1) == b"\x07"
    rig.clock.sleep_until(rig.clock.now() + 0.005)
    assert bus.read(7, 3, 1) == b"\x07"
    assert bus.response_timeout.allowance > 0.021
    assert bus.read(6, 3, 1) == b"\x06"


@both_back_ends
def test_the_answer_to_a_repeated_question_answers_no_other(rig: Rig) -> None:
    bus = rig.bus()
    for _ in range(30):
        bus.ping(6)
    rig.kit.faults.start("late", 6, amount=0.004, times=2)
    assert bus.read(6, 3, 1) == b"\x06"
    assert bus.counters.retried == 1
    # Asked at once for other registers of the same size; the second late answer was still under way.
    assert bus.read(6, 0, 1) == b"\x0c"


@both_back_ends
@pytest.mark.parametrize("moment", [0.0045, 0.006, 0.0071, 0.0072, 0.00725, 0.0074, 0.02])
def test_nor_does_it_come_between_a_later_question_and_its_answer(rig: Rig, moment: float) -> None:
    bus = rig.bus()
    for _ in range(30):
        bus.ping(6)
    rig.kit.faults.start("late", 6, amount=0.004, times=2)
    begin = rig.clock.now()
    assert bus.read(6, 3, 1) == b"\x06"
    assert bus.counters.retried == 1
    # The answer to the second try comes 7.3 ms after the beginning; a question and its answer take 0.15 ms.
    rig.clock.sleep_until(begin + moment)
    assert bus.read(6, 0, 1) == b"\x0c"
    assert bus.read(6, 3, 1) == b"\x06"


@both_back_ends
def test_a_late_answer_of_another_size_is_no_answer(rig: Rig) -> None:
    bus = rig.bus()
    for _ in range(30):
        bus.ping(6)
    rig.kit.faults.start("late", 6, amount=0.004, times=1)
    with pytest.raises(BusTimeout):
        bus.read(6, 3, 1, retries=0)
    assert len(bus.read(6, 36, 8)) == 8


@both_back_ends
def test_time_outs_get_short_when_answers_are_prompt(rig: Rig) -> None:
    bus = rig.bus()
    for _ in range(30):
        bus.ping(7)
    rig.kit.faults.start("silence", 6)
    start = rig.clock.now()
    with pytest.raises(BusTimeout):
        bus.ping(6, retries=0)
    assert rig.clock.now() - start < 0.0035


@both_back_ends
def test_after_a_burst_of_lateness_the_brief_time_out_is_still_short(rig: Rig) -> None:
    bus = rig.bus()
    for _ in range(30):
        bus.ping(7)
    rig.kit.faults.start("late", 7, amount=0.0029, times=4)
    for _ in range(30):
        bus.ping(7)
    assert bus.response_timeout.allowance > bus.response_timeout.brief_allowance
    rig.kit.faults.start("silence", 6)
    start = rig.clock.now()
    with pytest.raises(BusTimeout):
        bus.ask(packet.ping_packet(1, 6), 6, 0, brief=True)
    assert rig.clock.now() - start < 0.0035


def sync_read(bus: ServoBus, ids: Sequence[int], fast: bool = False) -> dict[int, bytes]:
    """The positions of those that answer."""
    request = packet.sync_read_packet(132, 4, ids, fast)
    answers = (bus.ask_joint if fast else bus.ask_group)(request, [(number, 4) for number in ids])
    return {status.device: status.params for status in answers}


@both_back_ends
def test_group_read_of_protocol_2_gives_what_there_is(x_rig: Rig) -> None:
    bus = x_rig.bus(2)
    assert sorted(sync_read(bus, range(1, 19))) == list(range(1, 19))
    x_rig.kit.faults.start("checksum", 5)
    assert sorted(sync_read(bus, range(1, 19))) == [n for n in range(1, 19) if n != 5]


@both_back_ends
def test_fast_reads(x_rig: Rig) -> None:
    for unit in x_rig.kit:
        unit.registers.put("firmware", 50)
    bus = x_rig.bus(2)
    assert sync_read(bus, [3, 7, 4], fast=True) == sync_read(bus, [3, 7, 4])


@both_back_ends
def test_sync_write_reaches_all(rig: Rig) -> None:
    bus = rig.bus()
    bus.sync_write(25, dict.fromkeys(range(1, 19), b"\x01"))
    assert all(bus.read(number, 25, 1) == b"\x01" for number in range(1, 19))


@both_back_ends
def test_reboot(x_rig: Rig) -> None:
    bus = x_rig.bus(2)
    bus.write(3, 65, b"\x01")
    bus.reboot(3)
    x_rig.clock.sleep_until(x_rig.clock.now() + 1.0)
    assert bus.read(3, 65, 1) == b"\x00"


@both_back_ends
@pytest.mark.parametrize("protocol", [1, 2])
def test_an_echoing_adapter_is_recognised(make_rig: Callable[[Bioloid], Rig], protocol: int) -> None:
    rig = make_rig(Bioloid(baud=1_000_000) if protocol == 1 else Bioloid.x_series(18, baud=1_000_000))
    rig.kit.faults.start("echo")
    bus = rig.bus("auto")
    found = scan(bus)
    assert (bus.echo, bus.protocol) == (True, protocol)
    assert [device.id for device in found.devices][:18] == list(range(1, 19))
    assert found.conflicts == ()
    bus.write(6, 25 if protocol == 1 else 65, b"\x01")
    bus.sync_write(25 if protocol == 1 else 65, {6: b"\x00"})
    assert bus.read(6, 25 if protocol == 1 else 65, 1) == b"\x00"
    if protocol == 2:
        assert len(sync_read(bus, range(1, 19))) == 18


@both_back_ends
def test_scan_finds_all_in_half_a_second(rig: Rig) -> None:
    start = rig.clock.now()
    found = scan(rig.bus())
    assert rig.clock.now() - start < 0.5
    assert [(d.id, d.name) for d in found.devices] == [*((n, "AX-12A") for n in range(1, 19)), (100, "AX-S1")]
    assert found.conflicts == ()
    assert found.devices[0].mode is tables.table_named("AX-12").mode_named("joint")
    assert found.devices[-1].mode is None


@both_back_ends
def test_scan_of_protocol_2_finds_all_in_half_a_second(x_rig: Rig) -> None:
    start = x_rig.clock.now()
    found = scan(x_rig.bus(2))
    assert x_rig.clock.now() - start < 0.5
    assert [(d.id, d.name) for d in found.devices] == [(n, "XL430-W250") for n in range(1, 19)]


@both_back_ends
def test_scan_credits_answers_that_a_slow_adapter_delivers_late(rig: Rig) -> None:
    rig.kit.faults.start("late", amount=0.016)
    found = scan(rig.bus())
    assert len(found.devices) == 19
    assert found.conflicts == ()


@both_back_ends
def test_scan_with_factory_return_delay(rig: Rig) -> None:
    for unit in rig.kit:
        unit.registers.put("return_delay", 250)
    found = scan(rig.bus())
    assert (len(found.devices), found.conflicts) == (19, ())


@both_back_ends
@pytest.mark.parametrize("delay", [0, 250])
def test_scan_detects_two_devices_with_one_id(rig: Rig, delay: int) -> None:
    from urbihw_fakes.dynamixel.ax12 import Ax12

    twin = Ax12(6)
    twin.registers.put("return_delay", delay)
    twin.set_baud(1_000_000)
    rig.kit.add(twin)
    found = scan(rig.bus())
    assert found.conflicts == (6,)
    assert [device.id for device in found.devices] == [n for n in (*range(1, 19), 100) if n != 6]


@both_back_ends
@pytest.mark.parametrize("late", [0.004, 0.016])
def test_scan_detects_two_devices_with_one_id_whose_answers_come_late(rig: Rig, late: float) -> None:
    twin = Ax12(6)
    twin.registers.put("return_delay", 0)
    twin.set_baud(1_000_000)
    rig.kit.add(twin)
    rig.kit.faults.start("late", amount=late)
    found = scan(rig.bus())
    assert found.conflicts == (6,)
    assert len(found.devices) == 18


@both_back_ends
def test_scan_detects_a_conflict_in_protocol_2(x_rig: Rig) -> None:
    from urbihw_fakes.dynamixel.xseries import XSeries

    twin = XSeries("XL430-W250", 6)
    twin.set_baud(1_000_000)
    twin.registers.put("return_delay", 0)
    x_rig.kit.add(twin)
    found = scan(x_rig.bus("auto"))
    assert found.conflicts == (6,)
    assert len(found.devices) == 17


@both_back_ends
def test_a_device_asked_for_by_name_gets_a_second_look(rig: Rig) -> None:
    rig.kit.faults.start("silence", 6, times=1)
    assert [device.id for device in scan(rig.bus(), [5, 6, 50]).devices] == [5, 6]


@both_back_ends
def test_a_device_that_is_held_up_in_the_middle_of_a_scan_is_asked_again(rig: Rig) -> None:
    asked = 0

    def hold_up() -> bool:
        nonlocal asked
        asked += 1
        if asked == 200:
            rig.kit.faults.start("silence", 6, times=3)
        return False

    found = scan(rig.bus(), urgent=hold_up)
    assert [(device.id, device.name) for device in found.devices][5] == (6, "AX-12A")
    assert len(found.devices) == 19


@both_back_ends
def test_scan_waits_for_the_last_as_long_as_for_others(rig: Rig) -> None:
    rig.kit.faults.start("late", amount=0.2)
    assert len(scan(rig.bus()).devices) == 19


def mixed_kit() -> Bioloid:
    """Two AX-12, an AX-S1, and two X servos on one wire."""
    units = [Ax12(1), Ax12(6), AxS1(100), XSeries("XL430-W250", 2), XSeries("XL330-M288", 7)]
    return Bioloid(units=units, baud=1_000_000)


@both_back_ends
def test_both_protocols_on_one_wire_are_found_and_spoken(make_rig: Callable[[Bioloid], Rig]) -> None:
    rig = make_rig(mixed_kit())
    bus = rig.bus("auto")
    found = scan(bus)
    assert [(device.id, device.protocol) for device in found.devices] == [(1, 1), (2, 2), (6, 1), (7, 2), (100, 1)]
    assert found.conflicts == ()
    for number, address in ((1, 25), (2, 65), (6, 25), (7, 65)):
        bus.write(number, address, b"\x01")
        assert bus.read(number, address, 1) == b"\x01"
        bus.ping(number)


@both_back_ends
def test_one_id_in_both_protocols_is_a_conflict(make_rig: Callable[[Bioloid], Rig]) -> None:
    rig = make_rig(Bioloid(units=[Ax12(1), XSeries("XL430-W250", 1), Ax12(2)], baud=1_000_000))
    found = scan(rig.bus("auto"))
    assert ([device.id for device in found.devices], found.conflicts) == ([2], (1,))


@both_back_ends
def test_scan_writes_nothing(rig: Rig) -> None:
    scan(rig.bus("auto"))
    # Ping or read.
    assert {instruction_of(line) for line in rig.sent()} == {"01", "02"}


@both_back_ends
def test_scan_of_an_empty_wire(make_rig: Callable[[Bioloid], Rig]) -> None:
    found = scan(make_rig(Bioloid(servos=(), sensors=())).bus("auto"))
    assert (found.devices, found.conflicts) == ((), ())
