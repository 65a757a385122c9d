"""Bodies for the simulated robots: their motors move a model in MuJoCo, and their sensors measure its world.

    python -m urbihw_fakes bioloid --world room --pty

The bus, its bytes and the registers stay those of the fake; only what moves them changes.  Reading order:
``simulation`` (a robot's model in a world, stepped by the clock of the fake), ``joint_servo`` and ``humanoid`` (a
Bioloid); ``wheels`` (what all bases have) and ``words`` (for their consoles), ``walls`` and ``pioneer``, ``tribot``,
``balance`` (a Segway), ``tracked`` and ``eye`` (a Spykee and its camera); ``nao_joints``, ``nao_senses``, ``glide`` and
``legged`` (a Nao).  ``models`` has the robots and ``worlds`` the rooms, as MJCF files of simple shapes: our own, under
the licence of this project, with the sources of their dimensions at their heads.

The package mujoco is needed only here, and imported when a world is asked for.
"""
