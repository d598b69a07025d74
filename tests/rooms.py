"""What the rooms offer, for the tests that look at all of it."""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Iterator
from typing import Any

#: What offers names, all of them documented, with parameters and what comes back.
DOCUMENTED = ("wildlab", "wildlab.tracking.particles")
#: Rooms whose examples are run.
WITH_EXAMPLES = (
    *DOCUMENTED,
    *("wildlab.geometry", "wildlab.navigation", "wildlab.tracking", "wildlab.simulation"),
    *("wildlab.evaluation", "wildlab.flight", "wildlab.reporting"),
    *("wildlab.analysis", "wildlab.detection", "wildlab.planning"),
    *("wildlab.api", "wildlab.sharing"),
)


def offered(room: str) -> Iterator[tuple[str, Any]]:
    """Names and what they stand for, as the room's ``__all__`` has them."""
    module = importlib.import_module(room)
    yield from ((name, getattr(module, name)) for name in module.__all__)


def lacking(name: str, thing: Any) -> list[str]:
    """Which sections a function's docstring lacks: parameters and what comes back, where there are any."""
    if not inspect.isfunction(thing):
        return []
    text = inspect.getdoc(thing) or ""
    signature = inspect.signature(thing)
    wanted = ["Parameters"] if signature.parameters else []
    wanted += [] if signature.return_annotation in ("None", None, "NoReturn") else ["Returns"]
    headings = {one: f"\n{one}\n{'-' * len(one)}\n" for one in wanted}
    found = [f"{name}: no section {one}" for one, heading in headings.items() if heading not in f"\n{text}\n"]
    # Up to the next heading: an example that names a parameter does not describe it.
    body = re.split(r"\n\n\w+\n-{4,}\n", text.partition("\nParameters\n")[2])[0]
    parameters = [one for one in signature.parameters if "Parameters" in wanted]
    listed = {
        word.strip().lstrip("*")
        for line in body.splitlines()
        if line and not line.startswith(" ")
        for word in line.partition(" : ")[0].split(",")
    }
    return found + [f"{name}: {one} is not described" for one in parameters if body and one not in listed]
