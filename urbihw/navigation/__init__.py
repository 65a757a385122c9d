"""Navigation for any base that drives: maps, paths, following them, odometry, localization by scans, lasers.

Nothing here depends on the wire or the maker of a base. Reading order: ``base`` (the interfaces that a platform
implements: ``Base``, and ``Scanner`` if it has one), ``navigator`` (the object of urbiscript that combines the other
modules); without I/O: ``frames`` (poses), ``maps`` and ``pictures`` (files), ``grid`` (a map as cells), ``standing``
(where on it the robot may be), ``planner`` (paths), ``obstacles`` (what sensors see beside the map, and what of it
is gone), ``drive`` (speeds, motions, safety distances), ``view`` (what a base sees of its way), ``follow`` (driving
along a path), ``localize`` (matching scans with a map), ``belief`` (how well the pose is known), ``locator``
(keeping and finding it), ``survey`` (building a map), ``loading`` (reading one), ``goal`` (what is pursued),
``drawing`` (pictures), ``background`` (work in threads); with numpy and scipy, loaded by ``extra``: ``arrays`` (ways),
``montecarlo`` (finding a carried robot), ``mapping`` (the map being built); objects of
urbiscript: ``odometry``, ``scanner``; ``pilot`` (a ``Base`` for a platform with wheels and odometry); ``lasers`` (the
lasers on wires of their own); ``options`` (the rows of the settings). Imports ``urbihw.kernel.uobject``,
``urbihw.buses`` and ``urbihw.settings``; the platforms may import it.
"""
