"""Jobs, time and tags: who runs when.  Knows no urbiscript, no socket and no wall clock of its own.

Reading order: ``clock`` (time is an argument), ``timequeue`` (who wakes when), ``coro`` (how a job is suspended),
``job`` (one flow of execution and its state), ``scheduler`` (run what is ready, return when to be called next),
``waiting`` (queues of jobs), ``group`` (a scope and the jobs it waits for), ``tag`` (stop, freeze, block), ``signals``
(what is thrown into a job), ``breaker`` (into one that does not yield), ``errors`` (what is refused), ``trace``
(hooks).
Only ``coro`` knows that the mechanism is greenlets.  May import nothing else of urbihw.
"""
