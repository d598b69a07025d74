"""Where the parts of the project that are not Python live.

wildlab is a workbench, not a library to install from an index: notebooks, data and reports stand beside the
package, and ``make`` installs it in place.
"""

from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
NOTEBOOKS = ROOT / "notebooks"
DATA = ROOT / "data"
REPORTS = ROOT / "reports"
LOCK = ROOT / "environment.lock"
