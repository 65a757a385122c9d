"""Sockets and real time: ``loop`` drives the scheduler from asyncio, ``tcp`` moves bytes between clients and
lobbies, ``interrupt`` is what Ctrl-C does.

May import ``lobby`` and ``sched``.
"""
