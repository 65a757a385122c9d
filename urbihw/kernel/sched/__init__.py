"""Jobs, time and tags.  Depends on neither urbiscript nor sockets nor a real clock.

Reading order: ``clock`` (time is an argument), ``timequeue`` (timers), ``coro`` (suspending jobs), ``job`` (one flow of
execution and its state), ``ready_queue`` and ``accounts`` (the order of the ready jobs), ``shares`` (how many jobs each
client may have), ``scheduler`` (runs them), ``hooks`` (callbacks to the layer above), ``waiting`` (how a job waits),
``group`` (a scope and the jobs it waits for), ``tag`` (stop, freeze, block), ``signals`` (exceptions thrown into jobs),
``breaker`` (interrupts a job that does not yield), ``collector`` (Python's garbage collector), ``errors``, ``trace``
(hooks for an observer), ``arrivals`` (when the input of a connection was ordered).  Only ``coro`` depends on greenlets.
May import no other package of urbihw."""
