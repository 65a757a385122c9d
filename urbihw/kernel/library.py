"""What authors of libraries import: packages of classes beside the standard library, such as ``urbihw.robot``.

Such a package is a ``Library``; ``stdlib`` tells what its modules may have.  It is part of the kernels that name it:
``Kernel(libraries=(ROBOT_LIBRARY,))``.
"""

from urbihw.kernel import errors
from urbihw.kernel.runtime.binary import BinaryObject
from urbihw.kernel.runtime.code import Executable, LazyPrimitive, Primitive
from urbihw.kernel.runtime.event import Emission, Event
from urbihw.kernel.runtime.holdings import holdings_of
from urbihw.kernel.runtime.object import Nil, Obj, Plain, Truth, Void
from urbihw.kernel.runtime.plain import escaped
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.slot import SlotMeta, meta_of, peek_meta
from urbihw.kernel.runtime.values import CallMessage, Dictionary, FloatObject, List, String, Tuple
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.errors import TooManyJobs
from urbihw.kernel.sched.job import Job
from urbihw.kernel.sched.signals import StopTag
from urbihw.kernel.sched.tag import Tag, TagEntry
from urbihw.kernel.sched.timequeue import Timer
from urbihw.kernel.sched.waiting import Completion, WaitQueue
from urbihw.kernel.stdlib import Library, prototype
from urbihw.kernel.stdlib.documentation import docstrings_of
from urbihw.kernel.stdlib.group import GroupObject
from urbihw.kernel.stdlib.lobby import own_lobby
from urbihw.kernel.stdlib.network import automatic_service
from urbihw.kernel.stdlib.object import as_string
from urbihw.kernel.stdlib.pipe import pipes_of
from urbihw.kernel.stdlib.properties import described_property, describers_of, find_property
from urbihw.kernel.stdlib.socket_channel import SocketChannel, SocketStream
from urbihw.kernel.stdlib.support import field
from urbihw.kernel.value import Value

__all__ = [
    "BinaryObject",
    "CallMessage",
    "Completion",
    "Dictionary",
    "Emission",
    "Event",
    "Executable",
    "FloatObject",
    "GroupObject",
    "Job",
    "LazyPrimitive",
    "Library",
    "List",
    "Nil",
    "Obj",
    "Plain",
    "Primitive",
    "SlotMeta",
    "SocketChannel",
    "SocketStream",
    "StopTag",
    "String",
    "Table",
    "Tag",
    "TagEntry",
    "Timer",
    "TooManyJobs",
    "Truth",
    "Tuple",
    "Value",
    "Void",
    "WaitQueue",
    "World",
    "as_string",
    "automatic_service",
    "described_property",
    "describers_of",
    "docstrings_of",
    "errors",
    "escaped",
    "field",
    "find_property",
    "holdings_of",
    "meta_of",
    "own_lobby",
    "peek_meta",
    "pipes_of",
    "prototype",
]
