"""What became of a ray to the ground: numbers that compiled functions return, and words for them."""

#: What becomes of a ray.
HIT, MISSED, NO_DATA, BELOW, NOT_KNOWN = 0, 1, 2, 3, 4

#: The same in words.
RAY_STATUS = {
    HIT: "met the ground",
    MISSED: "left the map without meeting the ground",
    NO_DATA: "came to where the map has no height",
    BELOW: "started below the ground",
    NOT_KNOWN: "has no direction or no start",
}
