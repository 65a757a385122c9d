"""Simulated robots: devices on real transports, for trying and testing without hardware.

A fake is a *device*: it has registers, physics, refusals and faults, and it answers bytes on a pty, a TCP port or in
memory as the real one would on its wire. Every fake is typed from the maker's data sheet and imports nothing of
`urbihw`, so that a driver and its fake cannot share a mistake; both are checked against `captures/*.hex`.

Who may import it: tests and benches. Nothing in the gateway imports it: `urbihw serve --fake` starts
`python -m urbihw_fakes` as a process of its own. In the tree it lies in the folder `fakes`.

Where to start: `device` (what a device is: bytes and a time in, timed answers out), then `endpoint` (how one is
reached) and `serving` (the loop behind it), `faults` (what can go wrong, the same words for every robot), then a
robot, for example `bioloid`. What a model leaves out is said at the head of its file.

    python -m urbihw_fakes bioloid --pty /tmp/bioloid
"""
