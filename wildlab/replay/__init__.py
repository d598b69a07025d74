"""A flight played back: what it was and saw, as arrays over time, as a recording, and as one page.

`scene` takes what is shown from a flight, `page` writes it as one file for any browser, `recording` for
rerun's viewer.
"""

from typing import TYPE_CHECKING

from wildlab.lazy import offer

if TYPE_CHECKING:
    from wildlab.replay.recording import show_replay
else:
    __getattr__, __dir__ = offer(__name__)

__all__ = ["show_replay"]
