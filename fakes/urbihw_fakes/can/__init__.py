"""Simulated CAN: what is on a bus, and the ways to put a bus within reach of another process.

Where to start: `node` (frames, and what a thing on a bus is), then `device` (a bus as bytes on a terminal), with its
codecs `slcan` (an adapter as sold, in its text) and `records` (frames as Linux lays them out), and `endpoint` (any
interface of python-can, multicast for one).
"""
