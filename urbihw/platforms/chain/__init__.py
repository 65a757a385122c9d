"""A chain of servos of any make on one bus, described by the settings.

Reading order: ``platform.toml`` (what the daemon knows without importing this), ``urbihw.platforms.servos`` (servos as
objects), ``robot`` (the object ``chain``), ``chain.u`` (the tree of the standard robot API).
"""
