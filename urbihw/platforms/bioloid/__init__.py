"""The Bioloid: AX-12 servos and AX-S1 sensors, or X-series servos, on one Dynamixel bus.

Reading order: ``platform.toml`` (what the daemon knows without importing this), ``slots`` (which register is which
slot, in which unit), ``devices`` (what all devices share), ``motors`` (what all servos share), ``ax12``, ``xservo`` and
``sensors`` (the classes AX12, XServo and AXS1), ``robot`` (the object ``bioloid``), ``bioloid.u`` (the functions that
are written in urbiscript).
"""
