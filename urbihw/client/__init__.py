"""How a program reaches a server: by a UNIX socket, by plain TCP, or by TLS with a pinned certificate and a token.

Reading order: ``where`` (which server, and by which way), ``credentials`` (whom we trust and who we are: the files of
fingerprints and tokens), ``entrance`` (the first words of a connection), ``connect`` (for programs that wait), ``dial``
(for those of asyncio).

May import nothing of urbihw: the commands and the remote devices both stand on it.
"""
