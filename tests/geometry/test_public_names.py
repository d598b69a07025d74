"""The room is quick to import."""

import re
import subprocess
import sys


def described(section: str, text: str) -> set[str]:
    """Names with a description in a section of a docstring in numpydoc's style."""
    found = re.search(rf"{section}\n-+\n(.*?)(?:\n\n[A-Z][a-z]+\n-+\n|\Z)", text, re.DOTALL)
    heads = re.findall(r"^(\S[^\n]*)$", found[1], re.MULTILINE) if found else []
    return {name.strip() for head in heads for name in head.split(",")}


def test_importing_it_brings_in_nothing_slow():
    code = (
        "import sys, wildlab.geometry\n"
        "slow = {'matplotlib', 'cv2', 'pandas', 'numba', 'scipy.stats', 'scipy.optimize'}\n"
        "print(*sorted(slow & set(sys.modules)))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
