"""Simulated Dynamixel units, protocol 1.0 and 2.0, on one half-duplex bus.

Written from ROBOTIS' e-manual, as collected in the project's Dynamixel sheet. Reading order: `packet1` and `packet2`
(bytes of the device side), `framer` (bytes -> requests), `registers` (a control table with its rules), `unit` with
`unit1` and `unit2` (execution of instructions), `bus` (the order and the times of answers), then the models:
`ax12`, `axs1`, `xseries` (with its tables in `xtables`), `servo` (the other families, with their tables in `families`),
and `catalogue` (all of them by name).
"""
