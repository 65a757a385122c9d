"""A Spykee in a small room, simulated, on TCP and UDP.

`device` is the robot behind its control connection, made of `packets` (bytes), `body` (tracks, place, dock, battery),
`camera` (its view of the room) and `sound` (microphone and loudspeaker); `endpoint` serves it, `start` has its
command line.  Typed from the fact sheet of the protocol, not from the driver: nothing of urbihw is imported here.
"""
