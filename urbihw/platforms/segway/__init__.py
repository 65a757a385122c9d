"""The Segway RMP 50, 100, 200 (and each half of a 400), on CAN or on its USB link.

Reading order: ``platform.toml`` (what the daemon knows without importing this), ``protocol`` (frames into values and
back) and ``usb`` (the maker's packets), both bytes only, ``line`` (either of the two over a port), ``monitor`` (what
the base says, put together), ``orders`` (configurations and whether they were obeyed), ``driver`` (the worker's half: a
command every tick), ``rmp`` (the class RMP of the manual), ``robot`` (the object ``segway``), ``usegway.u`` (how many
counts make a metre), ``rmp.u`` (the standard robot API).  Imports ``urbihw.kernel.uobject``, ``urbihw.buses`` and what
the robots share in ``urbihw.platforms``.
"""
