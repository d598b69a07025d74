"""The cases of the two theses, a file each: what is computed on a flight, and figures of it.

`protocol` says what a case offers, `rules` how units, claims and answers are read from ``data/studies``,
`page` what a page is made of. What several share: `monte_carlo` (many simulated flights beside the print),
`single_target` and `coverage_maps` (figures).

H is the doctoral thesis of H. H. Helgesen (NTNU, 2019), F the master's thesis of A. Flodell and
C. Christensson (Linköping University, 2016): see ``docs/references.md``.
"""
