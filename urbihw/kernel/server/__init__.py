"""Sockets and real time: ``loop`` drives the scheduler from asyncio, ``tcp`` listens for clients, ``connection`` moves
bytes between a client and its lobby, ``handshake`` detects other protocols, ``watchdog`` and ``memory`` limit what
programs use, ``interrupt`` handles Ctrl-C, ``exit_watchdog`` ends the process in time.

May import ``lobby`` and ``sched``.
"""
