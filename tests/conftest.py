"""What every test shares: when slow tests run, where larger data may lie, and how hypothesis behaves."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

#: Set by nearly every CI service; "false", "0" and "" count as not set.
IN_CI = os.environ.get("CI", "").lower() not in ("", "0", "false")

# No deadline anywhere: the first call of a compiled function takes seconds, and a busy machine is no fault.
settings.register_profile("here", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("ci", parent=settings.get_profile("here"), derandomize=True, print_blob=True)
settings.load_profile("ci" if IN_CI else "here")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--run-slow", action="store_true", help="also run tests marked slow (so does CI=true)")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave slow tests out, unless CI, ``--run-slow``, ``-m`` or a test named by ``::`` asks for them."""
    named = any("::" in argument for argument in config.args)
    if IN_CI or named or config.getoption("--run-slow") or config.getoption("markexpr"):
        return
    slow = [item for item in items if "slow" in item.keywords]
    if slow:
        config.hook.pytest_deselected(items=slow)
        items[:] = [item for item in items if "slow" not in item.keywords]


def find_shared_data(*parts: str) -> Path | None:
    """The file or folder of that name among data too large for the repository, or None.

    Looked for in the folder that ``WILDLAB_TEST_DATA`` names, else in ``shared/data`` beside the checkout.
    """
    named = os.environ.get("WILDLAB_TEST_DATA")
    root = Path(named) if named else Path(__file__).resolve().parents[1].parent / "shared" / "data"
    path = root.joinpath(*parts)
    return path if path.exists() else None


@pytest.fixture(scope="session")
def shared_data() -> Callable[..., Path]:
    """``shared_data("georeferencing", "openathena")`` gives the path, or skips the test without it."""

    def find(*parts: str) -> Path:
        path = find_shared_data(*parts)
        if path is None:
            name = "/".join(parts)
            pytest.skip(f"needs the data set {name}: set WILDLAB_TEST_DATA to the folder that holds it")
        return path

    return find
