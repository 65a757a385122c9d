"""Laser scanners as devices of any base that drives, each on a wire of its own with a worker of its own.

Reading order: ``device`` (the object of urbiscript, and the table of the models), ``driver`` (what all have in the
worker); then for each model its bytes, without I/O, and its driver: ``lms200`` and ``lms200driver`` (SICK LMS2xx),
``rplidar`` and ``rplidardriver`` (Slamtec), ``scip`` and ``scipdriver`` (Hokuyo), ``cola`` and ``coladriver`` (SICK
LMS1xx, TiM).  ``fitting`` gives a base the laser of its settings.

The packages on PyPI for these lasers (rplidar-roboticia, adafruit-circuitpython-rplidar, hokuyolx) open their ports
themselves, wait without a bound, and raise on a damaged byte; so the bytes are read here, and two of these packages
are witnesses in the tests of the simulated lasers where they are installed.
Imports ``urbihw.kernel.uobject``, ``urbihw.buses`` and ``urbihw.navigation``.
"""
