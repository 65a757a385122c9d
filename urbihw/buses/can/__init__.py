"""CAN: frames in and out of any adapter that python-can knows, and generic CANopen drives.

Where to start: `frame` (what is moved), then `port` (how a bus is opened by its url; `slcan` and `pipe` are two of its
ways), then drives after the CiA 402 profile: `network` (canopen without a thread), `cia402` (states and objects, as
tables), `drive` (one of them), `drives` (the worker's half). Needs the extra `can`.

    can://socketcan/can0                                a kernel interface: ip link set can0 up type can bitrate 500000
    can://slcan/dev/ttyACM0?bitrate=500000              a serial adapter with the Lawicel text
    can://udp_multicast/239.74.163.2?hop_limit=0        frames in datagrams, here on this machine only
    can://virtual/name                                  within one process
    can://pipe/name                                     within one test, in simulated time
    can://kvaser/0?bitrate=500000                       and what else python-can has, by its name

Beside them: `emergencies` (their codes in words), `options`, `trace` (frames for people).
"""
