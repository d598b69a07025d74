"""Does a flight make sense: what is known twice is held against itself, and usual mistakes are named.

Each file has the pairs of one kind, or the mistakes of one kind. `trial` has the rule by which a mistake is
named, `sense` asks all pairs of a flight.
"""
