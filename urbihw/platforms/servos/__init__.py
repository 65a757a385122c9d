"""What robots on a servo bus share: servos and other devices as objects of urbiscript.  It is no platform.

Reading order: ``slots`` (which register is which slot, in which unit), ``devices`` (what all devices share),
``registers`` (raw registers), ``frame`` and ``joint`` (offset, direction and range of a joint), ``motors`` (what all
servos share), ``anglelimits`` and ``modeservo`` (the two kinds of servos), ``otherdevice``, ``kinds`` (which class a
device gets), ``servolimits`` (limits in raw counts), ``growth`` (when the tree grows), ``missing`` (which devices are
expected and silent), ``robot`` (the base of the robots on such a bus), ``servos.u`` (the tree of such a robot, in
urbiscript).
"""
