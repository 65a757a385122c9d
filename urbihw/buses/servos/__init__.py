"""Smart servos and sensors on one half-duplex wire: Dynamixel, protocols 1.0 and 2.0, and Feetech.

Reading order: `packet` and `status` (bytes only), `tables` (control tables as data), `units` (raw counts to SI),
`transactions` and `bus` (ask and be answered), `scan` (who is there), `plan` and `health` (pure parts of the cycle),
`cycle` (one tick after the other), `stop` (the safe stop), `driver` (what the worker runs).
"""
