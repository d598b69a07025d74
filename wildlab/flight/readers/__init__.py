"""Whatever is neither a plain table nor MATLAB's: bytes in, columns out.

A reader of a raw log has two functions, ``sniff`` and ``decode``; `formats.FORMATS` knows them all. What is
decoded is judged in one place (`log`) and becomes a `log.RawLog`, whatever the format: named parts with
the same columns and units. A reader believes nothing that the log says of itself: what cannot be read is
left out and said in `RawLog.lost`, rows that cannot be true stay where they are and are marked (``use``,
``why``).

Areas, labels, frames, terrain and the Autoferry data have readers of their own. All raise
`wildlab.errors.WildlabError` with the place where a file is not what it should be.
"""
