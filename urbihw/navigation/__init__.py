"""Navigation for any base that drives: maps, paths, following them, odometry, localization by scans, a SICK laser.

Nothing here knows the wire or the maker of a base.  Reading order: ``base`` (what a platform must offer: a typed
``Base``, and a ``Scanner`` if it has one), ``navigator`` (the object of urbiscript that brings the rest together);
without I/O: ``frames`` (poses), ``maps`` and ``pictures`` (files), ``grid`` (a map as cells), ``planner`` (paths),
``drive`` (speeds, motions, room to keep), ``follow`` (driving along a path), ``localize`` (matching scans with a map);
objects of urbiscript: ``odometry``, ``scanner`` and ``sicklaser``; on the wire of a SICK laser: ``sick`` (bytes) and
``sickdriver`` (in its worker); ``options`` (the rows of the settings).
Imports ``urbihw.kernel.uobject``, ``urbihw.buses`` and ``urbihw.settings``; the platforms may import it.
"""
