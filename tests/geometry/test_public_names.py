"""The room is quick to import."""

import subprocess
import sys


def test_importing_it_brings_in_nothing_slow():
    code = (
        "import sys, wildlab.geometry\n"
        "slow = {'matplotlib', 'cv2', 'pandas', 'numba', 'scipy.stats', 'scipy.optimize'}\n"
        "print(*sorted(slow & set(sys.modules)))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
