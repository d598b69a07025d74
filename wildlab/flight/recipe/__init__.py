"""From raw tables to a flight folder, as a recipe says: what a recipe may say, and how it is done.

A recipe names units, axes and clocks of the raw columns; what comes out has those of `wildlab.flight`:
metres north, east and down, radians, seconds of flight time. ``data/recipes/README.md`` is for its writers.
"""

from typing import TYPE_CHECKING

from wildlab.lazy import offer

if TYPE_CHECKING:
    from wildlab.flight.recipe.importing import import_flight
    from wildlab.flight.recipe.model import Recipe, read_recipe
else:
    __getattr__, __dir__ = offer(__name__)

__all__ = [
    "Recipe",
    "import_flight",
    "read_recipe",
]
