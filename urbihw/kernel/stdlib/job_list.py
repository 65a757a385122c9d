"""System.jobsText: the jobs and the tags of all connections, for programs that show them.  Not in the manual.

docs/telemetry.md describes the text.  A job can be ended, and a tag stopped, frozen and unfrozen, by its id, whichever
connection made it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from typing import Any, Final

from urbihw.kernel import errors
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.tagscope import ScopeTag, TagObject
from urbihw.kernel.runtime.world import KERNEL_JOB, World
from urbihw.kernel.sched.job import WAITING, Job
from urbihw.kernel.sched.tag import Tag
from urbihw.kernel.stdlib.job import job_stack, job_value, terminate
from urbihw.kernel.value import Value

TABLE = Table("System")

MAX_JOBS: Final = 500
"""Jobs in a text, and tags; the total number is shown."""
ACTIONS: Final[dict[str, Callable[[World, Tag], None]]] = {
    "stop": lambda world, tag: tag.stop(world.void),
    "freeze": lambda world, tag: tag.freeze(),
    "unfreeze": lambda world, tag: tag.unfreeze(),
}


def _program_jobs(world: World) -> list[Job]:
    """The jobs of programs, without those that wait for the next statement of their client."""
    return [job for job in world.scheduler.jobs if job.face is not KERNEL_JOB and not _is_idle(world, job)]


def _is_idle(world: World, job: Job) -> bool:
    serves = job.context is not None and job.context.shell.serves(job)
    return serves and job.state == WAITING and not job_stack(job_value(world, job)).calls


def _is_shown(face: Any) -> bool:
    """Whether a tag is one of a program: not that of a connection, of a scope, or of the library."""
    return isinstance(face, TagObject) and not isinstance(face, ScopeTag) and not face.freeze_refusal


def _tags_in_use(world: World) -> Iterator[TagObject]:
    """The tags of programs with code under them: jobs, or handlers of events and conditions."""
    for tag in world.tag_proto.tag.descendants():
        if (tag.live or len(tag.hooks)) and _is_shown(tag.face):
            yield tag.face


def _job_row(world: World, job: Job) -> dict[str, Any]:
    value = job_value(world, job)
    calls = job_stack(value).calls
    place = next((str(call.location) for call in calls if call.location is not None), "")
    waits = next((call.name for call in calls if call.name), "")
    faces = [entry.tag.face for entry in job.entries if _is_shown(entry.tag.face)]
    return {
        "id": world.uid(value),
        "name": job.name,
        "lobby": lobby_name(world, job.context),
        "tags": [face.tag.name for face in faces],
        "state": job.state,
        "frozen": job.frozen,
        "until": None if job.timer is None or job.frozen else round(job.timer.deadline, 3),
        "in": waits,
        "line": place,
    }


def _tag_row(world: World, face: TagObject) -> dict[str, Any]:
    tag = face.tag
    jobs = {job for entry in tag.live for job in entry.jobs}
    return {
        "id": world.uid(face),
        "name": tag.name,
        "lobbies": sorted({lobby_name(world, job.context) for job in jobs}),
        "jobs": len(jobs),
        "handlers": len(tag.hooks),
        "frozen": tag.is_frozen(),
        "blocked": tag.blocker() is not None,
    }


def lobby_name(world: World, lobby: Any) -> str:
    """The name of a connection with its user and its address, as in the slot ``why`` of a device; "" for none."""
    if lobby is None:
        return ""
    return str(lobby.title)


@TABLE.primitive("jobsText")
def jobs_text(world: World, this: Value) -> str:
    """The running jobs of all connections, and the tags in use, as a text of JSON."""
    running = world.scheduler.running()
    jobs = [job for job in _program_jobs(world) if job is not running]
    tags = list(_tags_in_use(world))
    rows = {
        "time": round(world.scheduler.now, 3),
        "jobs": [_job_row(world, job) for job in jobs[:MAX_JOBS]],
        "tags": [_tag_row(world, face) for face in tags[:MAX_JOBS]],
        "number": [len(jobs), len(tags)],
    }
    return json.dumps(rows, separators=(",", ":"))


@TABLE.primitive("stopJob")
def stop_job(world: World, this: Value, job_id: str) -> None:
    """End the job with this id of ``jobsText``.  Raises an error if there is none."""
    for job in _program_jobs(world):
        if job.face is not None and world.uid(job.face) == job_id:
            terminate(world, job_value(world, job))
            return
    raise errors.primitive(f"no job {job_id}: it is over")


@TABLE.primitive("controlTag")
def control_tag(world: World, this: Value, tag_id: str, action: str) -> None:
    """``stop``, ``freeze`` or ``unfreeze`` the tag with this id of ``jobsText``.  Raises an error if there is no code
    under it.
    """
    act = ACTIONS.get(action)
    if act is None:
        raise errors.primitive(f"no action {action}; there are {', '.join(ACTIONS)}")
    for face in _tags_in_use(world):
        if world.uid(face) == tag_id:
            act(world, face.tag)
            return
    raise errors.primitive(f"no tag {tag_id}: nothing runs under it")
