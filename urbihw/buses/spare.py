"""A worker process that waits until it is needed: `python -m urbihw.buses.spare FD FAMILY URL`, the same as `child`.

It has a name of its own so that one sees in a list of processes which one owned the wire first.
"""

from __future__ import annotations

import sys

from urbihw.buses.child import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
