"""The Spykee of Meccano and Erector: two tracks, a camera, a microphone and a loudspeaker, on Wi-Fi.

Reading order: ``platform.toml``, ``protocol`` (bytes), ``discovery`` and ``link`` (how it is found and reached),
``session`` (login), ``driver`` with ``tracks`` and ``bulk`` (the driver, in the worker's process), ``robot`` with
``devices``, ``streams``, ``audio``, ``mp3`` and ``music``, ``calibration`` and ``clapper`` (the objects of urbiscript),
``tree.u`` (the standard robot API).
"""
