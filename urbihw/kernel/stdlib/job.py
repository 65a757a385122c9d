"""Job and Control: jobs as values, and functions that start jobs."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from urbihw.kernel.runtime.backtrace import LINE_MAP, NO_STACK, CallFrame, Stack, entry_of, later_stack
from urbihw.kernel.runtime.event import wait_for
from urbihw.kernel.runtime.location import make_frames
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.tagscope import TagObject
from urbihw.kernel.runtime.values import CallMessage
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.job import Job
from urbihw.kernel.stdlib import prototype
from urbihw.kernel.stdlib.members import callable_of
from urbihw.kernel.stdlib.support import native, send_line
from urbihw.kernel.value import Value

TABLE = Table("Job")
CONTROL = Table("Control")
TABLES = (TABLE, CONTROL)
PROTOS = {"Job": ("Object", "Traceable"), "Control": ("Object",)}

NOTES = {
    "Job": "A job, a sequence of statements in execution, as a value.",
    "Control": "Functions that start and control jobs.",
    "System.spawn": (
        "Run a function in a job of its own, without tags if the second argument is true, else under the caller's "
        "tags; returns the Job."
    ),
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


class JobObject(Obj):
    """An urbiscript Job; ``job`` is None for the prototype; ``origin`` tells the call stack at the start of the job."""

    __slots__ = ("job", "origin")

    def __init__(self, world: World, protos: list[Obj], job: Job | None = None) -> None:
        super().__init__(world, protos)
        self.job = job
        self.origin: Callable[[], Stack] = lambda: NO_STACK

    def known(self) -> Job:
        """The job.  Raises the type error for the prototype."""
        if self.job is None:
            raise self.world.type_error(None, self, "Job")
        return self.job


CLASSES = {"Job": JobObject}


def job_value(world: World, job: Job) -> JobObject:
    """The Job object of a job; there is one per job."""
    if job.face is None:
        proto: Any = world.classes["Job"]
        job.face = JobObject(world, [proto], job)
    face = job.face
    assert isinstance(face, JobObject)
    return face


# ---------------------------------------------------------------- Job


@TABLE.primitive("asJob")
def as_job(world: World, this: Value) -> Value:
    """Returns this value itself."""
    return this


@TABLE.primitive("clone", "new")
def clone(world: World, this: Value) -> Value:
    """This value: a job cannot be cloned."""
    return this


@TABLE.primitive("asString")
def as_string(world: World, this: JobObject) -> str:
    """``Job<name>``."""
    return "Job" if this.job is None else f"Job<{this.job.name}>"


@TABLE.primitive("name")
def name(world: World, this: JobObject) -> str:
    """The name of the job."""
    return this.known().name


@TABLE.primitive("status")
def status(world: World, this: JobObject) -> str:
    """``starting``, ``running``, ``sleeping``, ``waiting`` or ``terminated``, with `` (frozen)`` when a tag freezes the
    job.
    """
    return this.known().status()


@TABLE.primitive("tags")
def tags(world: World, this: JobObject) -> Value:
    """The tags under which the job runs, outermost first; empty for a job of another connection."""
    job = this.known()
    asking = world.scheduler.running().context
    faces = [entry.tag.face for entry in job.entries] if job.context in (asking, None) else []
    return world.new_list([face for face in faces if isinstance(face, TagObject)])


@TABLE.primitive("backtrace")
def backtrace(world: World, this: JobObject) -> Value:
    """The call stack of the job, as a List of StackFrames, innermost first."""
    return make_frames(world, job_stack(this))


def job_stack(this: JobObject) -> Stack:
    """The call stack of a waiting job, including the calls that started it; empty if the job has ended."""
    job = this.known()
    if job.done:
        return NO_STACK
    frame = job.frame()
    calls: list[Any] = []
    while frame is not None:
        line_map = frame.f_globals.get(LINE_MAP)
        if line_map is not None and not line_map.system:
            calls += [step for step in line_map.frames(entry_of(frame)) if step.name is not None]
        frame = frame.f_back
    origin = this.origin()
    if origin is not NO_STACK:
        calls += [CallFrame(origin.location, origin.routine), *origin.calls]
    return Stack(None, None, tuple(calls))


@TABLE.primitive("dumpState")
def dump_state(world: World, this: JobObject) -> None:
    """Print the name, state, tags and call stack of the job."""
    job = this.known()
    lines = [f"Job: {job.name}", f"  State: {job.status()}", "  Tags:"]
    lines += [f"    {world.text(tag)}" for tag in tags(world, this).l]
    lines.append("  Backtrace:")
    lines += [f"    {step.location}: {step.name}" for step in job_stack(this).calls]
    for line in lines:
        send_line(world, f"*** {line}")


@TABLE.primitive("setSideEffectFree")
def set_side_effect_free(world: World, this: JobObject, value: Value) -> None:
    """Accepted and ignored: this scheduler evaluates a condition only when a slot that it reads is written."""


@TABLE.primitive("terminate")
def terminate(world: World, this: JobObject) -> None:
    """End the job; its finally clauses run.  The job that runs a client's input continues with the next statement."""
    job = this.known()
    if job.context is not None and job.context.shell.serves(job):
        job.context.shell.interrupt()
    else:
        world.scheduler.kill(job)


@TABLE.primitive("timeShift")
def time_shift(world: World, this: JobObject) -> float:
    """The time in seconds during which the job was frozen."""
    job = this.known()
    return job.shift + (world.scheduler.clock.now() - job.frozen_at if job.frozen and not job.done else 0.0)


@TABLE.primitive("waitForChanges")
def wait_for_changes(world: World, this: Value) -> None:
    """Let the other jobs run."""
    world.scheduler.yield_()


@TABLE.primitive("waitForTermination")
def wait_for_termination(world: World, this: JobObject) -> None:
    """Wait until the job has ended."""
    wait_for(world, this.known())


# ---------------------------------------------------------------- Control


def starter(world: World) -> Callable[[Callable[[], Any], bool], JobObject]:
    """A function that starts a job, with the tags of the running job or (``clear``) without them."""
    def start(body: Callable[[], Any], clear: bool) -> JobObject:
        maker = world.scheduler.running()
        entries: Iterable[Any] = () if clear else maker.entries
        name = maker.context.shell.next_name() if maker.context is not None else maker.name
        made = world.scheduler.spawn(body, name, context=maker.context, entries=entries)
        made.descend(maker)
        world.scheduler.prefer(made)
        value = job_value(world, made)
        value.origin = later_stack()
        return value

    return start


@CONTROL.lazy("finally", least=2, most=2)
def finally_(world: World, message: CallMessage) -> Value:
    """Call the first function and then, however it ended, the second one."""
    action, reaction = message.eval_at(0), message.eval_at(1)
    try:
        return world.invoke(action, message.target)
    finally:
        world.invoke(reaction, message.target)


def install(world: World, programs: Any) -> None:
    """Install ``detach``, ``disown`` and ``spawn``, which share the counter of job names."""
    start = starter(world)
    jobs = Table("Control")

    @jobs.lazy("detach", least=1, most=1)
    def detach(world: World, message: CallMessage) -> Value:
        """Evaluate an expression in a new job under the same tags; returns the Job."""
        return start(message.args[0].force, False)

    @jobs.lazy("disown", least=1, most=1)
    def disown(world: World, message: CallMessage) -> Value:
        """Evaluate an expression in a new job without tags; returns the Job."""
        return start(message.args[0].force, True)

    control = prototype(world, "Control")
    jobs.install(world, control)
    for name in ("detach", "disown"):
        world.global_.slots[name] = control.slots[name]

    def spawn(this: Value, function: Value, clear: Any) -> Value:
        wanted = callable_of(world, function)
        return start(lambda: world.invoke(wanted, this), bool(clear))

    prototype(world, "System").slots["spawn"] = native(world, "spawn", spawn, 2)
