"""The Pioneer 3-DX and its kin: ARCOS on a serial line or on TCP; laser, maps and paths by ``urbihw.navigation``.

Reading order: ``platform.toml`` (what the daemon knows without importing this), ``options`` (what may be configured);
on the wire, bytes only: ``protocol``, ``commands``, ``sip``, ``packets``, ``camera``, and ``factors`` (what differs
between the robots);
in the worker: ``handshake``, ``setpoint`` and ``driver``;
in SI units: ``arcos`` and ``robot`` (the object ``P3dx``), ``devices`` (what it consists of), ``navigation`` (odometry,
laser and planner, which are those of ``urbihw.navigation``), ``p3dx.u`` (the tree of components).
Imports ``urbihw.kernel.uobject``, ``urbihw.buses``, ``urbihw.navigation`` and what all platforms share only.

``gripper`` and ``gyro`` are accessories.
"""
