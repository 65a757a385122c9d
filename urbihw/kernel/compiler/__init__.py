"""urbiscript to Python: ``compile_node`` is ``codegen(bind(node))``.

Reading order: ``bind`` with ``walk`` and ``scopes`` (which names are local variables, which of them inner functions
capture), ``emit`` (small helpers that build Python syntax), ``codegen`` and its parts, each built on the one before:
``expressions``, ``places``, ``functions``, ``statements``, ``concurrency`` (one method per node), ``pieces`` (what is
too long for Python to compile in one go), ``linemap`` (an instruction's "line number" back to urbiscript), ``unit``
(the result, and how to run it), ``cache`` and ``library`` (units kept in memory and on the disk), ``late`` (arguments
of a call whose function turned out to be lazy).  May import ``syntax`` only: what generated code needs at run time it
takes from ``runtime/ops.py`` by name.
"""

from urbihw.kernel.compiler.unit import Unit, compile_node
from urbihw.kernel.syntax.printer import print_node

__all__ = ["Unit", "compile_node", "print_node"]
