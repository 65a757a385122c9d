"""The Pioneer 3-DX and its kin: ARCOS on a serial line or on TCP, a SICK laser, maps and path planning.

Reading order: ``platform.toml`` (what the daemon knows without importing this);
on the wire, bytes only: ``protocol``, ``commands``, ``sip``, ``packets``, ``sick``, ``visca``, and ``factors`` (what
differs between the robots);
in the workers: ``driver`` (the robot), ``laserdriver`` (the laser);
in SI units: ``robot`` (the object ``P3dx``), ``devices`` (what it consists of), ``drive`` (speeds, distances, safety),
``p3dx.u`` (the tree of components);
the planner: ``maps`` (files), ``grid``, ``planner`` (paths), ``follow`` (driving along one), ``localize`` (where am I).
Imports ``urbihw.kernel.uobject``, ``urbihw.buses`` and what all platforms share only.
"""
