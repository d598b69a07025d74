"""The cases of the two theses, a folder each: what is computed and claimed, and how it is shown and said.

`protocol` says what a case has to offer. What several share stands beside the folders: `monte_carlo` (many
simulated flights beside the print) and `single_target` (figures of one target's tracks).

H is the doctoral thesis of H. H. Helgesen (NTNU, 2019), F the master's thesis of A. Flodell and
C. Christensson (Linköping University, 2016): see ``docs/references.md``.
"""
