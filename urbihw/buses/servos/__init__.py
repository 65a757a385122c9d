"""Smart servos and sensors on one half-duplex wire: Dynamixel, protocols 1.0 and 2.0, and Feetech.

Reading order: `packet` and `status` (bytes only), `tables` (control tables as data), `units` (raw counts to SI),
`transactions` and `bus` (ask and be answered), `scan` (who is there), `plan` and `health` (pure parts of the cycle),
`cycle` (one tick after the other), `stop` (the safe stop), `driver` (what the worker runs), `access` (its requests).

Beside them: `crc`, `line` (its speed), `item` (one register), `registers`, `eeprom` and `indirect` (how they are
written), `answers` and `response_timeout` (waiting for one), `device` and `member` (one servo, found and in the cycle),
`following` and `bodywatch` (what its joint does), `unheld` (what a limit cannot hold), `readings` and `alarms` (its
health), `kept` (whether it has started anew), `toss` (a CM-5 in between), `trace` (packets for people), `options`.

For set-up: `survey` with `quiet` and `findings` (who is there, at any speed), `changes` (of a servo), `registers_file`
(backups), `calibration` and `hand_calibration`.
"""
