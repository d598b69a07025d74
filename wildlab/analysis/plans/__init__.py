"""From areas to flights: rows, heights, sorties, what they see, what forbids them, and what is said."""
