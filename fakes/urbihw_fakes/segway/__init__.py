"""A simulated Segway RMP.

Reading order: `frames` (the frames on the bus), `body` (the physics), `rmp` (the base: modes, supervision, a hundred
monitoring cycles per second), `usb` (the maker's USB link), `console` (its commands).

Written from the frames that libsegwayrmp, Player, CARMEN, Orca and other drivers send and read, and from a log of a
real bus in Orca; the maker's own interface guide was not available.
"""
