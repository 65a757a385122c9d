"""Command numbers of ARCOS and MobileSim (ARCOS chapter of the Pioneer 3 manual; ARIA, ``ArCommands.h``)."""

from __future__ import annotations

from typing import Final

SYNC0: Final = 0
"""The first packet of a new connection; SYNC1 and SYNC2 follow."""
OPEN: Final = 1
CLOSE: Final = 2
POLLING: Final = 3
ENABLE: Final = 4
SETA: Final = 5
SETV: Final = 6
SETO: Final = 7
MOVE: Final = 8
ROTATE: Final = 9
SETRV: Final = 10
VEL: Final = 11
HEAD: Final = 12
DHEAD: Final = 13
JOYREQUEST: Final = 17
CONFIG: Final = 18
ENCODER: Final = 19
RVEL: Final = 21
SETRA: Final = 23
SONAR: Final = 28
STOP: Final = 29
DIGOUT: Final = 30
GRIPPER: Final = 33
VEL2: Final = 32
IOREQUEST: Final = 40
TTY2: Final = 42
GETAUX: Final = 43
BUMPSTALL: Final = 44
HOSTBAUD: Final = 50
E_STOP: Final = 55
GYRO: Final = 58
BATTERYINFO: Final = 62
# Commands of MobileSim.
SIM_SET_POSE: Final = 224
SIM_RESET: Final = 225
SIM_LRF_ENABLE: Final = 230
SIM_LRF_START: Final = 231
SIM_LRF_END: Final = 232
SIM_LRF_INCREMENT: Final = 233
BATTEST: Final = 250
RESET: Final = 253
