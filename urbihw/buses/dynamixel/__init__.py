"""Dynamixel servos and sensors on one half-duplex wire.

Reading order: `packet` and `status` (bytes only), `tables` (control tables as data), `units` (raw counts to SI),
`bus` (ask and be answered), `plan` and `health` (pure parts of the cycle), `cycle` (one tick after the other),
`driver` (what the worker runs).
"""
