"""A memory card as it is: which file is what, which role each has in a flight, and a recipe that says so."""
