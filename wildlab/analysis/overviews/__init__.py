"""A flight as a whole: what it recorded, what went wrong on the way, and what is most worth fixing."""
