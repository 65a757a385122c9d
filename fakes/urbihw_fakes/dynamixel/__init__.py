"""Dynamixel units in software, protocol 1.0 and 2.0, on one half-duplex bus.

Typed from ROBOTIS' e-manual as gathered in the project's Dynamixel sheet. Reading order: `packet1` and `packet2` (bytes
of the device side), `framer` (bytes -> requests), `registers` (a control table with its rules), `unit` with `unit1` and
`unit2` (what a device does with an instruction), `bus` (who answers, when, and in which order), then the models:
`ax12`, `axs1`, `xseries` (with its tables in `xtables`).
"""
