"""What befalls a robot on trial, at random: stops, lost links, hands, other masters; see ``random_trial``."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

from random_programs import TICK
from random_trial import DEAD_MAN, Trial

from urbihw.buses import messages as m


def live(platform: str, seconds: float, seed: int, folder: Path) -> Trial:
    """Let a robot live for so long, with random programs and faults; fails as ``Trial`` does."""
    trial = Trial(platform, random.Random(f"{seed} {platform}"), folder)
    Fate(trial).live(seconds)
    return trial


class Fate:
    """What befalls a trial."""

    def __init__(self, trial: Trial) -> None:
        self.trial, self.rng, self.plant = trial, trial.rng, trial.plant
        self.tags: list[tuple[str, int]] = []
        self.plugged = True
        self.events: dict[Callable[[], None], float] = {
            self.stop: 4, self.estop: 2, self.hold: 1, self.reconnect: 3, self.unplug: 2, self.silent: 2,
            self.power: 1, self.noise: 2, self.replace: 1, self.neighbour: 3,
        }  # fmt: skip
        if self.plant.hands:
            self.events[self.hand] = 6
        if self.plant.others:
            self.events[self.other_master] = 2
        if self.plant.limits:
            self.events[self.reload] = 2

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
            (event,) = rng.choices(list(self.events), list(self.events.values()))
            trial.befell[event.__name__] += 1
            event()
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
            trial.released()

        trial.say(self.rng.choice(list(trial.clients)), f"{trial.motion.slot}.estop = true;")
        trial.model.stop(trial.now())
        trial.model.latched = True
        self.later(self.rng.uniform(0.5, 4.0), release)

    def hold(self) -> None:
        """The kernel stands still for a while, as when the process is stopped."""
        trial = self.trial
        trial.note("the kernel stands still")
        self.later(DEAD_MAN + 2 * TICK, lambda: trial.model.stop(trial.now()))
        trial.model.delay(DEAD_MAN + 2 * TICK)
        trial.silence(3.0)
        trial.note("the kernel goes on")

    def neighbour(self) -> None:
        """A program holds the interpreter, for less than the time of the dead man."""
        trial = self.trial
        seconds = self.rng.uniform(0.2, 1.2)
        trial.note(f"a neighbour holds the interpreter for {seconds:.2f} s")
        trial.model.delay(seconds)
        trial.silence(seconds)

    def hand(self) -> None:
        """A hand takes a joint, perhaps turns it, and lets it go after a while."""
        trial = self.trial
        device = self.rng.choice(list(self.plant.hands))
        (part,) = self.plant.devices[device]
        if part in trial.grips:
            return
        held = self.rng.uniform(0.8, 3.0)
        way, turning = self.rng.choice((0.0, 0.3, 0.8)), self.rng.choice((0.2, 0.4, 0.6))
        trial.note(f"a hand takes {device} for {held:.1f} s, turns it by {way} rad in {turning} s")
        trial.grip(device, way, turning)
        self.later(held, lambda: trial.let_go(device))

    def other_master(self) -> None:
        """Another master moves the robot."""
        trial = self.trial
        push = self.rng.choice(self.plant.others)
        trial.note(f"another master moves {push.parts}")
        push.go(trial.lab)
        trial.pushed(push)

    def reload(self) -> None:
        """The settings are read again, with other limits."""
        limits = {part: self.rng.choice((None, 0.5, 1.0)) for part in self.plant.limits}
        self.trial.set_limits({part: share for part, share in limits.items() if share is not None})

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
