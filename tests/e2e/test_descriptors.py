"""A worker of a daemon that has more than 1024 files open."""

from __future__ import annotations

import os
import resource
from queue import Queue

from urbihw.buses.messages import FromWorker, LinkState
from urbihw.buses.worker import Worker


def test_a_worker_runs_whatever_number_its_pipe_has() -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(4096, hard), hard))
    files = [os.open(os.devnull, os.O_RDONLY) for _ in range(1100)]
    heard: Queue[FromWorker] = Queue()
    try:
        with Worker.start("/dev/no-such-port", post=heard.put):
            first = heard.get(timeout=20)
            assert isinstance(first, LinkState) and "no such port" in first.reason
    finally:
        for file in files:
            os.close(file)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
