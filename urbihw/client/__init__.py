"""Connects a program to a server: by a UNIX socket, by plain TCP, or by TLS with a pinned certificate and a token; and
the library for programs in Python, ``urbihw.connect``.

Reading order: ``where`` (the address of a server), ``credentials`` (the files of fingerprints and tokens), ``login``
(the first lines of a TLS connection), ``connect`` (blocking sockets), ``secure`` (a blocking TLS socket), ``dial``
(asyncio).  Then the output of a server: ``lines`` (bytes to lines), ``values`` (lines to values).

The library, from below: ``errors``, ``literals`` (Python values to urbiscript), ``media`` (pictures, sounds),
``dialect`` (the statements that are sent), ``streams`` (samples, events), ``session`` (a connection without its
socket), ``core`` (the commands of a connection, as steps), ``connection`` (does the steps with a blocking socket, for
threads), ``iterators``, ``leases``, ``objects`` and ``robot`` (what programs see), ``shown`` and ``live_plot``
(notebooks), ``aio_connection`` and ``aio`` (the same for asyncio).  The commands use ``connection``, the gateway and
the console ``aio_connection``.

Beside them: ``driving`` (a base by repeated orders), ``interrupts`` (Ctrl-C), ``latch`` (the file of an emergency
stop), ``stubs`` (typed modules of robots), ``subject`` (what is completed) and ``assistant`` (with which names).

May import nothing of urbihw but ``started``: the commands and the remote devices both use it.
"""
