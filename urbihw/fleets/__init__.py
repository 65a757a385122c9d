"""Many robots in one network: the bridge of a robot to its fleet, and the fleet as programs see it (docs/fleet.md).

A robot has a bridge, a process beside the daemon: a client of the daemon by one connection of its own and one for each
far client that drives, and of the control socket of the bus worker, so that a stop does not need the interpreter.  The
bridges meet at a router of zenoh.  The death of a bridge or a router costs no tick and no robot.

Reading order: ``names`` (keys), ``told`` (what others tell, checked), ``settings``, ``meeting`` (sessions of zenoh,
who is there), ``served`` (what the robot tells), ``drivers`` (leases of far clients), ``orders`` (what a far client may
ask), ``bridge`` (what runs).  For programs: ``line`` (questions and answers, blocking), ``program``
(``urbihw.fleet``), ``script`` (``Fleet`` in urbiscript).

May import the client side (``urbihw.client``), the control socket of the daemon, the verdict on the health of a
robot, and what the web gateway knows of a tree: what may be read, written and called from outside.  It never imports
the kernel or a platform.  Needs the extra ``fleet``; ``meeting``, ``bridge`` and ``line`` import zenoh.
"""
