"""The Pioneer 3-DX and its kin: ARCOS on a serial line or on TCP, a SICK laser, maps and path planning.

Reading order: ``platform.toml`` (what the daemon knows without importing this), ``options`` (what may be configured);
on the wire, bytes only: ``protocol``, ``commands``, ``sip``, ``packets``, ``sick``, ``camera``, and ``factors`` (what
differs between the robots);
in the workers: ``handshake``, ``setpoint`` and ``driver`` (the robot), ``laserdriver`` (the laser);
in SI units: ``arcos`` and ``robot`` (the object ``P3dx``), ``devices`` and ``laserdevice`` (what it consists of),
``drive`` (speeds, and room to keep), ``p3dx.u`` (the tree of components);
the planner: ``maps`` and ``pictures`` (files), ``grid``, ``planner`` (paths), ``follow`` (driving along one),
``localize`` (where am I), ``navigator`` (the object ``P3dx.planner``, which brings them together).
Imports ``urbihw.kernel.uobject``, ``urbihw.buses`` and what all platforms share only.
"""
