"""``with refused("no such file", field="camera"):`` what stands in it raises an error that says so."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from wildlab.errors import WildlabError


@contextmanager
def refused(words: str | None = None, *, field: str | None = None) -> Iterator[None]:
    """``words``: a regular expression for the message; ``field``: what the error says it is about."""
    with pytest.raises(WildlabError, match=words) as caught:
        yield
    if field is not None:
        assert caught.value.field == field
