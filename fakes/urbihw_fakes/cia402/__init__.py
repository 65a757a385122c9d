"""A simulated servo drive after CiA 402: a LocalNode of canopen with a motor behind it.

Where to start: `dictionary` (its objects), `machine` (the states of the profile and the motor), `node` (what a
LocalNode leaves to its user: boot, process data, gating, the watch over its master), `start` (how it is reached).

Written from CiA 301 and CiA 402 as drives' manuals quote them. Needs canopen, which is in the extra `can`.
"""
