"""What the room offers by name: all of it, described argument by argument, and quick to import."""

import ast
import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

from wildlab import geometry

FUNCTIONS = {
    name: one
    for name in geometry.__all__
    if inspect.isfunction(one := getattr(geometry, name)) and one.__name__ == name
}


def described(section: str, text: str) -> set[str]:
    """Names with a description in a section of a docstring in numpydoc's style."""
    found = re.search(rf"{section}\n-+\n(.*?)(?:\n\n[A-Z][a-z]+\n-+\n|\Z)", text, re.DOTALL)
    heads = re.findall(r"^(\S[^\n]*)$", found[1], re.MULTILINE) if found else []
    return {name.strip() for head in heads for name in head.split(",")}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_argument_and_result_is_described(name):
    one = FUNCTIONS[name]
    text = inspect.cleandoc(one.__doc__)
    assert described("Parameters", text) == set(inspect.signature(one).parameters)
    assert described("Returns", text)
    raised = set(re.findall(r"raise (\w+)\(", inspect.getsource(one)))
    assert raised <= described("Raises", text)


def test_all_that_is_public_is_offered():
    """But for what F names as frames does, clocks of cameras, which the pipeline offers, what other rooms
    look up (quantiles, attitudes between two), and what is inside: compiled loops, compiling, and checks."""
    beside = {"flodell.camera_rotation", "georeference.matching"}
    beside |= {f"{name}.{name}" for name in ("clock_by_points", "clock_by_motion")}
    beside |= {f"turns.between_attitudes{how}" for how in ("", "_by_scipy")}
    beside |= {f"quantiles.{name}_quantile" for name in ("chi2", "normal", "student")} | {
        "quantiles.chi2_beyond"
    }
    offered = {f"{one.__module__.rpartition('.')[2]}.{one.__name__}" for one in FUNCTIONS.values()}
    there = set()
    for path in Path(geometry.__file__).parent.glob("*.py"):
        if path.stem not in ("__init__", "compilation", "validation") and not path.stem.endswith("_kernels"):
            body = ast.parse(path.read_text()).body
            there |= {f"{path.stem}.{one.name}" for one in body if isinstance(one, ast.FunctionDef)}
    assert {name for name in there if "._" not in name} == offered | beside


def test_importing_it_brings_in_nothing_slow():
    code = (
        "import sys, wildlab.geometry\n"
        "slow = {'matplotlib', 'cv2', 'pandas', 'numba', 'scipy.stats', 'scipy.optimize'}\n"
        "print(*sorted(slow & set(sys.modules)))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
