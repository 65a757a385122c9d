"""The LEGO MINDSTORMS NXT: a brick on USB or Bluetooth with three motors and four sensors.

Reading order: ``platform.toml`` (what the daemon knows without importing this), ``protocol`` (telegrams as bytes),
``exchange`` (one of them in flight), ``reading`` and ``i2c`` (what is read over and over), ``motion`` (what goes out),
``driver`` (all of that in a worker); then ``ports`` (who owns a port), ``motors``, ``sensors`` and ``others`` (the
classes of the manual), ``robot`` (the object ``nxt``), ``TriBot.u`` (the default layout).
"""
