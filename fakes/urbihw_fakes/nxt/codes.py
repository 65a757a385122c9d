"""Numbers of the protocol: telegram types, status bytes, sensor types and modes (firmware: c_comm.h, c_cmd.iom)."""

from __future__ import annotations

from typing import Final

# Telegram types, byte 0.
DIRECT: Final = 0x00
SYSTEM: Final = 0x01
REPLY: Final = 0x02
SILENT: Final = 0x80  # added to the first two: no reply requested

# Status bytes of replies.
OK: Final = 0x00
PENDING: Final = 0x20
MAILBOX_EMPTY: Final = 0x40
NO_MORE_HANDLES: Final = 0x81
NO_SPACE: Final = 0x82
NO_MORE_FILES: Final = 0x83
END_OF_FILE: Final = 0x85
NOT_LINEAR: Final = 0x86
FILE_NOT_FOUND: Final = 0x87
HANDLE_CLOSED: Final = 0x88
FILE_FULL: Final = 0x8E
FILE_EXISTS: Final = 0x8F
MODULE_NOT_FOUND: Final = 0x90
ILLEGAL_NAME: Final = 0x92
ILLEGAL_HANDLE: Final = 0x93
UNKNOWN_OPCODE: Final = 0xBE
INSANE: Final = 0xBF
OUT_OF_RANGE: Final = 0xC0
BUS_ERROR: Final = 0xDD
BUSY: Final = 0xE0
NO_PROGRAM: Final = 0xEC
ILLEGAL_SIZE: Final = 0xED
BAD_MAILBOX: Final = 0xEE

# Output modes and run states.
MOTOR_ON: Final = 0x01
BRAKE: Final = 0x02
REGULATED: Final = 0x04
IDLE: Final = 0x00
RAMP_UP: Final = 0x10
RUNNING: Final = 0x20
RAMP_DOWN: Final = 0x40
SYNCHRONISED: Final = 2

# Sensor types.
NO_SENSOR: Final = 0x00
SWITCH: Final = 0x01
RCX_LIGHT: Final = 0x03
LIGHT_ACTIVE: Final = 0x05
LIGHT_INACTIVE: Final = 0x06
SOUND_DB: Final = 0x07
SOUND_DBA: Final = 0x08
LOWSPEED: Final = 0x0A
LOWSPEED_9V: Final = 0x0B
COLOUR_FULL: Final = 0x0D
COLOUR_NONE: Final = 0x11

# Sensor modes; the low five bits are the slope.
RAW: Final = 0x00
BOOLEAN: Final = 0x20
TRANSITIONS: Final = 0x40
PERIODS: Final = 0x60
PERCENT: Final = 0x80
MODE_MASK: Final = 0xE0
