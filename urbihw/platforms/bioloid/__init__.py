"""The Bioloid: AX-12 servos and AX-S1 sensors, or X-series servos, on one Dynamixel bus.

Reading order: ``platform.toml`` (what the daemon knows without importing this), ``urbihw.platforms.servos`` (servos
as objects), ``sensors`` (the class AXS1), ``robot`` (the object ``bioloid``), ``bioloid.u`` (the functions that are
written in urbiscript).

``sensorslots`` has the slots of the AX-S1.
"""
