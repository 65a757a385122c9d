"""Connects a program to a server: by a UNIX socket, by plain TCP, or by TLS with a pinned certificate and a token.

Reading order: ``where`` (the address of a server), ``credentials`` (the files of fingerprints and tokens), ``login``
(the first lines of a TLS connection), ``connect`` (blocking sockets), ``secure`` (a blocking TLS socket), ``dial``
(asyncio).  Then the output of a server: ``lines`` (bytes to lines), ``values`` (lines to values).

May import nothing of urbihw: the commands and the remote devices both use it.
"""
