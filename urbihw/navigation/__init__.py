"""Navigation for any base that drives: maps, paths, following them, odometry, localization by scans, a SICK laser.

Nothing here depends on the wire or the maker of a base.  Reading order: ``base`` (the interfaces that a platform
implements: ``Base``, and ``Scanner`` if it has one), ``navigator`` (the object of urbiscript that combines the other
modules); without I/O: ``frames`` (poses), ``maps`` and ``pictures`` (files), ``grid`` (a map as cells), ``planner``
(paths), ``drive`` (speeds, motions, safety distances), ``follow`` (driving along a path), ``localize`` (matching scans
with a map); objects of urbiscript: ``odometry``, ``scanner`` and ``sicklaser``; ``pilot`` (a ``Base`` for a platform
with wheels and odometry); on the wire of a SICK laser: ``sick`` (bytes) and ``sickdriver`` (in its worker); ``options``
(the rows of the settings). Imports ``urbihw.kernel.uobject``, ``urbihw.buses`` and ``urbihw.settings``; the platforms
may import it.
"""
