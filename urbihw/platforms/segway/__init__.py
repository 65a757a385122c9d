"""The Segway RMP 50, 100, 200 (and each half of a 400), on CAN or on its USB link.

Reading order: ``platform.toml`` (what the daemon knows without importing this), ``protocol`` (frames into values and
back) and ``usb`` (the maker's packets), both bytes only, ``line`` (either of the two over a port), ``monitor`` (the
state of the base, from its frames), ``orders`` (configurations and their confirmation), ``driver`` (the driver in the
worker: a command every tick), ``rmp`` (the class RMP of the manual), ``robot`` (the object ``segway``), ``usegway.u``
(counts per metre), ``rmp.u`` (the standard robot API).  Imports ``urbihw.kernel.uobject``, ``urbihw.buses`` and the
shared modules of ``urbihw.platforms``.

``bases`` (one, or two halves as one), ``channels`` (two wires to one base), ``navigation``.
"""
