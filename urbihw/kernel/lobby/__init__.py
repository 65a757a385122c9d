"""One connection's world: bytes in, jobs, lines out.

Reading order: ``output`` (time-stamped lines, bounded), ``lobby`` (the object and its life), ``shell`` (statements to
jobs), ``templates`` (statements that differ in their literals only), ``program_files`` (cached code of loaded files),
``printing`` (values and errors as text).  May import ``compiler``, ``syntax`` (through it), ``runtime`` and ``sched``;
does not depend on sockets.

Beside them: ``statements`` (run for a program), ``connection_tag``, ``lease`` (silent clients), ``long_work`` (long
programs), ``server_log`` and ``host_process`` (what ``System`` shows), ``advice`` (what to write
instead of a frequent mistake).
"""
