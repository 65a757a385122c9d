"""The figure of a robot: its links, joints and shapes, from one file beside each platform, ``figure.toml``.

The same table makes a URDF, the picture in the panel (as JSON), and tells where a part of the robot is.

Reading order: ``model`` (the table, checked), ``pose`` (places and turns), ``kinematics`` (where the links are for some
readings of the joints), ``reach`` (how a link comes to a place), ``urdf``; ``bench`` (joints of which nothing else is
known).  It knows neither robots nor urbiscript: readings come as numbers.  SciPy, of the extra ``navigation``, is
imported by ``reach`` when it is used.

Lengths are in m, angles in rad; x is ahead, y to the left, z up.  A turn is roll, pitch and yaw about the fixed axes of
the link above, as in URDF.
"""

from urbihw.figure.model import BadFigure, Figure, FigureJoint, FigureLink, FigureShape

__all__ = ["BadFigure", "Figure", "FigureJoint", "FigureLink", "FigureShape"]
