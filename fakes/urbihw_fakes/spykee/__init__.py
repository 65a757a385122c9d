"""A Spykee in a small room, simulated, on TCP and UDP.

`device` is the robot behind its control connection, made of `packets` (bytes), `body` (tracks, place, dock, battery),
`camera` (what it sees of the room) and `sound` (its ears and its mouth); `endpoint` serves it, `start` says how it is
reached.  Typed from the fact sheet of the protocol, not from the driver: nothing of urbihw is imported here.
"""
