"""Teach and play, for every robot with joints: motions recorded by hand, poses by name, motions played from files.

Reading order: ``recording`` (the file of a motion or a pose), ``mtn`` (motion files of RoboPlus), ``course`` (from
files to the angles at each moment), ``store`` (the folder), ``motions`` (the part of a robot with joints), ``teach.u``
(the slots of ``robot``, in urbiscript).  A platform uses it by the part ``TaughtMotions`` of its robot, and by
``MotionPlayer.equip(robot, controller)`` in its library.
"""
