"""A flight played back: what it was and saw, as arrays over time, as a recording, and as one page.

`scene` says what is shown, `gather` takes it from a flight, `recording` writes it for rerun's viewer, `page`
puts that and the viewer itself into one file that opens from disk.
"""

from typing import TYPE_CHECKING

from wildlab.lazy import offer

if TYPE_CHECKING:
    from wildlab.replay.recording import show_replay
else:
    __getattr__, __dir__ = offer(__name__)

__all__ = ["show_replay"]
