"""What urbihw costs, beside plain Python and the other drivers: each module is a bench, `python -m bench.NAME`.

The benches use the labs of the tests, so the folders of the tests are on the path of modules here.
"""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
"""The folder of the project."""
_LABS = ("", "e2e", "platforms", "hostile", "browser")

sys.path.extend(str(ROOT / "tests" / folder) for folder in _LABS)
