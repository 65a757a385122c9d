"""The urbiscript kernel.  ``Kernel`` is its whole door: start, feed, run, stop.

Reading order: ``syntax`` (text to nodes), ``compiler`` (nodes to Python), ``sched`` (jobs, time, tags), ``runtime``
(objects), ``stdlib`` (the classes), ``lobby`` (a connection), ``server`` (sockets), ``uobject`` (devices), ``boot``,
``library`` (what other libraries import), ``process`` (signals, ports and the end of a process that has a kernel).

``facade`` is where ``Kernel`` is defined. Beside them: ``value`` (what urbiscript passes around), ``errors``,
``recursion`` (the limit of calls), ``stages`` (what the commands show of the compiler), ``uremote`` (devices in other
processes).
"""

from urbihw.kernel.facade import Kernel

__all__ = ["Kernel"]
