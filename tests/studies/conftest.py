"""The small flight whose every error is known, of the pipeline's tests."""

from tests.pipeline.conftest import make_flight

__all__ = ["make_flight"]
