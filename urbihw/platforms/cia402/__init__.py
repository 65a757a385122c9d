"""Servo drives after CiA 402 on a CANopen bus: any make, any number.

Reading order: ``platform.toml``, ``servo`` (the class ServoDrive), ``robot`` (the object ``cia402``), ``cia402.u`` (the
standard robot API).  What speaks to the drives is in ``urbihw.buses.can``.  Imports ``urbihw.kernel.uobject``,
``urbihw.buses`` and what the robots share in ``urbihw.platforms``.
"""
