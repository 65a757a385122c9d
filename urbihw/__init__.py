"""urbihw: a gateway daemon that serves the hardware of robot kits as live urbiscript objects.

What to read, in order: ``kernel`` (the language), ``buses`` (wires), ``navigation`` (maps and paths), ``platforms``
(robots), ``daemon`` and ``cli`` (the programs that users start).  The simulated robots are beside this package, in
``urbihw_fakes``.
"""
