"""To look at a simulated world in MuJoCo: its pictures, its state, and films of it.

The simulator, the worker of the platform ``webots`` or the process of a simulated robot, gives two things: the file
of its model and, again and again, its *state*: all that can change in a picture (``state``).  Nothing is drawn there,
so that looking holds up neither the physics nor the wire; and nothing goes back, so that looking moves nothing.

``view`` is the object ``worldView`` of urbiscript.  Its pictures are drawn by a process of their own (``drawing``,
``painter``, ``painting``).  ``urbihw view`` shows the states in MuJoCo's window; ``urbihw film`` draws recorded ones
(``recording``).  ``library`` imports mujoco.
"""
