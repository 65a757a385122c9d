"""The runtime of compiled urbiscript: objects, slots, functions, events, tags, trajectories.

Reading order: ``object`` and ``slots`` (look-up), ``code`` (functions), ``values`` (strings, lists ...), ``world`` (one
kernel's objects and the verbs of native code) with ``failures`` (conversion of errors) and ``lazy_names`` (what the
compiler knows of them), ``ops`` with ``ops_slots``, ``ops_jobs`` and ``ops_assert`` (the verbs of generated code),
``watch`` and ``event`` with ``conditions`` (at, whenever, waituntil), ``tagscope`` (tagged code), ``backtrace`` and
``location`` (the place of an error), ``primitive`` (tables of built-ins) with ``arguments`` (their checks).  May import
``sched``, ``kernel.errors`` and ``kernel.value`` only.
"""
