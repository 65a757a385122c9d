"""The LEGO MINDSTORMS NXT: a brick on USB or Bluetooth with three motors and four sensors.

Reading order: ``platform.toml`` (what the daemon knows without importing this), ``protocol`` (telegrams as bytes),
``exchange`` (requests and replies over a link), ``reading`` and ``i2c`` (periodic readings), ``motion`` (targets),
``driver`` (the driver in the worker); then ``ports`` (owners of ports), ``motors``, ``sensors`` and ``others`` (the
classes of the manual), ``robot`` (the object ``nxt``), ``TriBot.u`` (the default layout).

``navigation`` is its planner.
"""
