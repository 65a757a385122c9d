"""UObjects in a process of their own: loads modules of devices, joins a server, and reconnects to it.

``run`` is all that ``urbi-launch --remote`` needs.  Reading order: ``launch`` (modules, exit codes), ``connection``
(the connection and its reconnection).  ``urbihw.kernel.uremote.bridge`` handles the protocol on the connection.
"""

from urbihw.remote.launch import run

__all__ = ["run"]
