"""A Segway RMP in software.

Where to start: `frames` (what is on the bus), `body` (how the machine moves), `rmp` (the base: its modes, its
supervision, its hundred monitoring cycles a second), `usb` (the maker's USB link), `console` (what can be typed at it).

Written from the frames that libsegwayrmp, Player, CARMEN, Orca and other drivers send and read, and from a log of a
real bus in Orca; the maker's own interface guide was not available.
"""
