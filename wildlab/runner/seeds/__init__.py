"""Numbers computed once for each seed: the key they are kept under, and the files they are kept in."""
