"""From raw tables to a flight folder, as a recipe says: what a recipe may say, and how it is done."""
