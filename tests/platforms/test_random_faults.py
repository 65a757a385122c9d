"""No motion of a body that no live statement asked for: random programs, random faults, all platforms, simulated time.

Two clients say random programs (``random_programs``); every few seconds something befalls the robot.  What is checked
at each tick: ``random_trial``.

    URBIHW_SEED     the seed, 1 if not said, so that each run is the same; printed, and told by a failure
    URBIHW_SECONDS  simulated seconds for each platform; 3600 is the hour
"""

from __future__ import annotations

import os
import random
from collections.abc import Callable
from pathlib import Path

import pytest
from motions import DEAD_MAN
from random_programs import TICK
from random_trial import SEED, Trial

from urbihw.buses import messages as m
from urbihw.platforms import folders

SECONDS = float(os.environ.get("URBIHW_SECONDS", "60"))


class Fate:
    """What befalls a trial."""

    def __init__(self, trial: Trial) -> None:
        self.trial, self.rng, self.plant = trial, trial.rng, trial.plant
        self.tags: list[tuple[str, int]] = []
        self.plugged = True
        self.events: dict[Callable[[], None], float] = {
            self.stop: 4, self.estop: 2, self.hold: 1, self.reconnect: 3, self.unplug: 2, self.silent: 2,
            self.power: 1, self.noise: 2, self.replace: 1,
        }  # fmt: skip

    def live(self, seconds: float) -> None:
        """Programs and events for so long."""
        trial, rng = self.trial, self.rng
        end = trial.now() + seconds
        while trial.now() < end:
            if self.trial.motion.revive and not trial.model.latched:
                trial.tell(trial.control, f"{trial.motion.revive};")
            for _ in range(rng.randint(1, 4)):
                self.client_speaks()
                trial.run(rng.choice((TICK, 0.1, 0.5, 1.0)))
            rng.choices(list(self.events), list(self.events.values()))[0]()
            trial.run(rng.choice((0.0, TICK, 0.3, 1.0, 2.5, 3.5)))
            trial.listen()

    def client_speaks(self) -> None:
        """A client begins a program, or does something to one."""
        trial, rng = self.trial, self.rng
        client = rng.choice(list(trial.clients))
        choice = rng.random()
        if choice < 0.65 or not self.tags:
            self.program(client)
        elif choice < 0.75:
            device, text = rng.choice(list(self.plant.zeros.items()) or [(None, "")])
            trial.say(client, text)
            if device is not None:
                trial.model.stood(set(self.plant.devices[device]), trial.now())
        elif choice < 0.85:
            trial.model.trip(trial.now())
            trial.say(client, "trip!;")
        else:
            self.tag(client)

    def program(self, client: int) -> None:
        """A client begins a program."""
        trial = self.trial
        trial.count += 1
        tag = f"t{trial.count}"
        program = self.rng.choice(self.plant.recipes)(self.rng)
        if program.form != "plain":
            trial.tell(trial.control, f'var Global.{tag} = Tag.new("{tag}")|;')
            self.tags = [*self.tags[-5:], (tag, 0)]
        trial.model.begin(program, client, tag, trial.now())
        trial.say(client, program.said(tag, trial.folder))

    def tag(self, client: int) -> None:
        """A client stops, freezes or unfreezes what has a tag."""
        trial = self.trial
        index = self.rng.randrange(len(self.tags))
        tag, frozen = self.tags[index]
        verb = self.rng.choice(("unfreeze", "stop") if frozen else ("freeze", "freeze", "stop"))
        trial.say(client, f"{tag}.{verb};")
        if verb == "stop":
            trial.model.tag_stopped(tag, trial.now())
            del self.tags[index]
        else:
            trial.model.freeze(tag, trial.now(), verb == "freeze")
            self.tags[index] = tag, int(verb == "freeze")

    # ---------------------------------------------------------------- events

    def later(self, seconds: float, action: Callable[[], None]) -> None:
        """Do something then, whatever happens meanwhile."""
        self.trial.due.append((self.trial.now() + seconds, action))

    def stop(self) -> None:
        """One of the clients stops the robot."""
        slot = self.trial.motion.slot
        self.trial.say(self.rng.choice(list(self.trial.clients)), self.rng.choice(("robot.stop;", f"{slot}.stop;")))
        self.trial.model.stop(self.trial.now())

    def estop(self) -> None:
        """An emergency stop, released some time later."""
        trial = self.trial
        if trial.model.latched:
            return

        def release() -> None:
            trial.note("release")
            trial.tell(trial.control, f"{trial.motion.slot}.estop = false;")
            trial.model.latched = False

        trial.say(self.rng.choice(list(trial.clients)), f"{trial.motion.slot}.estop = true;")
        trial.model.stop(trial.now())
        trial.model.latched = True
        self.later(self.rng.uniform(0.5, 4.0), release)

    def hold(self) -> None:
        """The kernel stands still for a while, as when the process is stopped."""
        trial = self.trial
        trial.note("the kernel stands still")
        self.later(DEAD_MAN + 2 * TICK, lambda: trial.model.stop(trial.now()))
        trial.silence(3.0)
        trial.note("the kernel goes on")

    def reconnect(self) -> None:
        """A client goes, another comes."""
        trial = self.trial
        old = self.rng.choice(list(trial.clients))
        lobby = trial.clients.pop(old)
        new = max((old, *trial.clients)) + 1
        trial.note(f"client {old} is closed, client {new} comes")
        lobby.close()
        trial.lab.run(0)
        trial.model.closed(old, trial.now())
        trial.clients[new] = trial.lab.kernel.open_lobby()

    def fault(self, name: str, seconds: float, begin: Callable[[], object], end: Callable[[], object]) -> None:
        """Something fails for some time."""
        trial = self.trial

        def heal() -> None:
            trial.note(f"{name}: healed")
            trial.sick -= 1
            end()

        trial.note(f"{name} for {seconds:.1f} s")
        trial.sick += 1
        begin()
        self.later(seconds, heal)

    def unplug(self) -> None:
        """The adapter is pulled, and put back."""
        trial = self.trial
        if not self.plugged:
            return
        before = dict(trial.down)

        def pull() -> None:
            self.plugged = False
            trial.motion.unplug(trial.lab)
            trial.down, trial.missed = dict.fromkeys(trial.down, True), False

        def put() -> None:
            self.plugged = True
            trial.motion.plug(trial.lab)
            self.later(1.0, look)

        def look() -> None:
            if trial.missed and not trial.linked:
                trial.faulty["link"] = trial.now()
            elif not trial.missed and trial.linked:
                trial.note("nobody has missed the link")
                trial.down = {device: down and before[device] for device, down in trial.down.items()}

        self.fault("unplugged", self.rng.choice((0.1, 0.5, 2.0)), pull, put)

    def silent(self) -> None:
        """A device does not answer."""
        device, unit = self.rng.choice(list(self.plant.units.items()))
        faults = self.plant.device(self.trial.lab).faults
        seconds = self.rng.choice((0.05, 0.3, 1.0, 3.0))
        self.fault(
            f"{device} silent", seconds, lambda: faults.start("silence", unit), lambda: faults.stop("silence", unit)
        )

    def power(self) -> None:
        """A device has no power."""
        trial = self.trial
        device, unit = self.rng.choice(list(self.plant.units.items()))
        end = self.plant.device(trial.lab)
        now = trial.lab.bus_clock.now
        without = {device} if unit is not None else {*self.plant.devices}
        if without & trial.dark:
            return
        trial.dark |= without

        def coasted() -> None:
            trial.dark -= without

        def end_of_dark() -> None:
            end.power_on(now(), unit)
            # It has forgotten all orders, so it goes on coasting until somebody notices.
            self.later(self.plant.settle, coasted)

        self.fault(
            f"{device} has no power", self.rng.choice((0.3, 1.0, 3.0)),
            lambda: end.power_off(now(), unit), end_of_dark,
        )  # fmt: skip

    def noise(self) -> None:
        """Garbage on the wire."""
        lab = self.trial.lab
        word, times = self.rng.choice(self.plant.garbage), self.rng.choice((1, 5, 30))
        self.trial.note(f"{word} {times} times")
        if word == "raw":
            self.plant.end(lab).send(self.rng.randbytes(times), lab.bus_clock.now())
        else:
            self.plant.device(lab).faults.start(word, None, times=times)

    def replace(self) -> None:
        """The worker is killed; another one takes its place."""
        trial = self.trial
        trial.note("the worker is replaced")
        trial.model.stop(trial.now())
        trial.down = dict.fromkeys(trial.down, True)
        # All that was ever sent would not fit into the pipe of the next one.
        last: dict[object, m.ToWorker] = {}
        for message in trial.lab.worker.sent:
            key = (message.device, message.items) if isinstance(message, m.Watch) else type(message)
            last.pop(key, None)
            last[key] = message
        trial.lab.worker.sent = [*last.values()]
        settings = [message for message in last.values() if isinstance(message, m.Configure)]
        trial.worker_killed(self.rng.choice((0.1, 0.5)))
        trial.lab.worker.sent += settings[-1:]
        if self.plugged:
            trial.faulty["link"] = trial.now()


@pytest.mark.parametrize("platform", [folder.name for folder in folders()])
def test_nothing_moves_that_no_live_statement_asked_for(platform: str, tmp_path: Path) -> None:
    print(f"URBIHW_SEED={SEED} URBIHW_SECONDS={SECONDS:g}")
    trial = Trial(platform, random.Random(f"{SEED} {platform}"), tmp_path)
    Fate(trial).live(SECONDS)
    share = trial.quiet_ticks * TICK / SECONDS / len(trial.parts)
    print(f"{platform}: stood after {trial.slowest_rest:.2f} s at most, {share:.0%} of the time nobody asked")
    assert SECONDS < 30 or (trial.way > 1.0 and share > 0.05), "this has shown nothing"
