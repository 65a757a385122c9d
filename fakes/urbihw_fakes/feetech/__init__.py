"""Simulated Feetech servos, series STS (little endian) and SCS (big endian), on one half-duplex bus.

Written from the vendor's memory tables and C++ headers, as collected in the project's Feetech sheet. Reading order:
`tables` (registers as data), `memory` (byte order, signs, EEPROM and its lock), `motion` (the motor), `servo`
(instructions, alarms, calibration), `bus` (sync read), then `console` and `start`.
"""
