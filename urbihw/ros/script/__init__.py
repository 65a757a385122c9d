"""``Ros`` of urbiscript: the manual's chapter 21, on the node of a process of its own (``urbihw.ros.worker``).

Reading order: ``link`` (the process and what is said with it), ``conversion`` (messages as values), then the modules of
the library: ``ros`` (the graph, parameters, offered services), ``topic`` and ``service``.  The process is started by
the first call that needs it; calls suspend their job.  Imports nothing of the kernel but its door for libraries.
"""

from urbihw.kernel.library import Library

__all__ = ["ROS_LIBRARY"]

ROS_LIBRARY = Library("urbihw.ros.script", ("ros", "topic", "service"))
"""The library of ROS; its modules in the order of loading."""
