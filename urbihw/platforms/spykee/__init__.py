"""The Spykee of Meccano and Erector: two tracks, a camera, a microphone and a loudspeaker, on Wi-Fi.

Reading order: ``platform.toml``, ``protocol`` (bytes), ``discovery`` and ``link`` (how it is found and reached),
``session`` (login), ``driver`` with ``tracks`` and ``bulk`` (who speaks to it, in the worker's process), ``robot`` with
``devices``, ``streams``, ``audio``, ``calibration`` and ``clapper`` (the objects of urbiscript), ``tree.u`` (the
standard robot API).
"""
