"""The runtime of compiled urbiscript: objects, slots, functions, events, tags, trajectories.

Reading order: ``object`` and ``slots`` (look-up), ``code`` (functions), ``values`` (strings, lists ...), ``world`` (one
kernel's objects and the verbs of native code) with ``failures`` (conversion of errors) and ``lazy_names`` (what the
compiler knows of them), ``ops`` with ``ops_slots``, ``ops_jobs`` and ``ops_assert`` (the verbs of generated code),
``watch`` and ``event`` with ``conditions`` (at, whenever, waituntil), ``tagscope`` (tagged code), ``backtrace`` and
``location`` (the place of an error), ``primitive`` (tables of built-ins) with ``arguments`` (their checks).  May import
``sched``, ``kernel.errors`` and ``kernel.value`` only.

Beside them: ``lookup`` and ``slot`` (inherited slots, and what a slot has beside its value), ``spelling``, ``convert``
and ``binary``, ``matching`` (patterns), ``trajectory`` and ``blend`` (values over time), ``notifier`` (conditions that
no job watches), ``record`` and ``redefinition`` (what programs changed of the library), ``holdings`` (sockets and
processes of a connection), ``identifiers``, ``plain`` and ``unread`` (errors as text, and errors that no program has
read), ``remains`` (large lists that end).
"""
