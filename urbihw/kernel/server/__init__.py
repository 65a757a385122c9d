"""Sockets and real time: ``loop`` drives the scheduler from asyncio, ``tcp`` listens for clients, ``connection`` moves
bytes between a client and its lobby, ``handshake`` detects other protocols, ``watchdog`` and ``memory`` limit what
programs use, ``interrupt`` handles Ctrl-C, ``exit_watchdog`` ends the process in time.

Beside them: ``acceptor`` (listening sockets), ``bounds`` (of the programs of one connection), ``disconnects`` (clients
that are not read), ``log_tap`` (the log in its kernel).

May import ``lobby`` and ``sched``.
"""
