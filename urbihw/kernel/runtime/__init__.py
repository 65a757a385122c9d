"""What compiled urbiscript runs on: objects, slots, functions, events, tags, trajectories.

Reading order: ``object`` and ``slots`` (look-up), ``code`` (what can be called), ``values`` (strings, lists ...),
``world`` (one kernel's objects and the verbs of native code), ``ops`` (the verbs of generated code), ``watch`` and
``event`` with ``conditions`` (at, whenever, waituntil), ``passage`` (tagged code), ``backtrace`` (where an error
happened), ``primitive`` (tables of built-ins).  May import ``sched`` and ``kernel.errors`` only.
"""
