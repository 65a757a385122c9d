"""UObjects in a process of their own: loads modules of devices, joins a server, and stays joined.

``run`` is all that ``urbi-launch --remote`` needs.  Reading order: ``launch`` (modules, signals, exit codes), ``link``
(the connection, and coming back after it was lost).  What is said on the connection is the business of
``urbihw.kernel.uremote.bridge``.
"""

from urbihw.remote.launch import run

__all__ = ["run"]
