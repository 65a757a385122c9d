"""Sockets and real time: ``loop`` drives the scheduler from asyncio, ``tcp`` moves bytes between clients and lobbies.

May import ``lobby`` and ``sched``.
"""
