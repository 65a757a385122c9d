"""A robot of ours as a node of ROS: a client of its server, in a process of its own (``urbihw ros``).

Reading order: ``parts`` (what the robot has), ``readings`` (values of the robot as messages), ``feeds`` (topics that
are read from the server while somebody follows them), ``motion`` (topics that move the robot), ``bridge`` (all of it).

It is a client like any other: what it moves belongs to its connections, so leases, limits, stops and reasons hold.
Frames and units are those of REP 103 and 105.  Imports nothing of the kernel or of a platform.
"""
