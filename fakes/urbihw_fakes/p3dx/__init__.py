"""A simulated Pioneer 3-DX: an ARCOS controller and a SICK LMS200 in a small world of walls.

Reading order: ``world`` (walls, rays), ``body`` (how the robot moves and where it believes to be), ``sonar``, ``codec``
and ``sips`` (bytes), ``arcos`` (the controller), ``extras`` (its encoders, inputs, gyro ...), ``simlaser`` (the laser
as MobileSim sends it), ``camera`` (pan, tilt and zoom on AUX1), ``laser`` (the LMS200 on a line of its own), ``kit``
(all of it together), ``start`` and ``console`` (what a person can do to it).

Typed from the ARCOS chapter of the Pioneer 3 manual, the LMS2xx telegram listing, ARIA, Player and MobileSim; checked
against ``captures/p3dx.hex``.  Not modelled: the gripper, the arm, docking, AUX2 and AUX3, the compass module,
sonars that see around corners or hear each other, glass, the laser's configuration telegrams; and, but in a world of
``urbihw_fakes.bodies``, wheels that slip apart.
"""
