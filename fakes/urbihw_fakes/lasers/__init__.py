"""Simulated laser scanners that see the room of the robot that carries them, each on its real transport.

``rays`` (what any of them measures), ``rplidar`` (Slamtec, a serial line), ``urg`` (Hokuyo with SCIP 2, USB or a serial
line) and ``cola`` (SICK LMS1xx, TCP).  That of a SICK LMS200 is in ``urbihw_fakes.p3dx``.

Typed from the makers' protocol documents.  Not modelled: materials, the time that one turn takes, settings.
"""
