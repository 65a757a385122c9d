"""urbiscript to Python: ``compile_node`` is ``write_unit(bind(node))``.

Reading order:

- ``compile``: one statement from its node to its unit; ``unit``: the result, and how to run it.
- ``bind`` with its visitors ``bind_names`` and ``bind_flow``, ``walk`` and ``scopes``: which names are local variables,
  which of them inner functions capture.  What is found out is kept on the nodes, see ``syntax.binding``.
- ``codegen``: which class of nodes has which visitor; ``writer``: what the visitors write to, with ``emit``, small
  helpers that build Python syntax; ``visit``: from a node to its visitor.
- The visitors: ``expressions``, ``operators`` with the tables of ``operations``, ``places``, ``functions``,
  ``statements``, ``loops``, ``concurrency``, ``conditions``; and ``control``, which several of these need.
- ``pieces``: what is too long for Python to compile in one go; ``linemap``: an instruction's "line number" back to
  urbiscript; ``late``: arguments of a call whose function turned out to be lazy; ``cache`` and ``library``: units kept
  in memory and on the disk.

May import ``syntax`` only: what generated code needs at run time it takes from ``runtime/ops.py`` by name.
"""

from urbihw.kernel.compiler.compile import compile_node
from urbihw.kernel.compiler.unit import CompiledUnit
from urbihw.kernel.syntax.printer import print_node

__all__ = ["CompiledUnit", "compile_node", "print_node"]
