"""Raw logs as they come off a memory card, one file per format: bytes in, a `RawLog` of named parts out.

Every reader gives the same parts with the same columns and units (`log.PARTS`), whatever the format calls
them; `formats.FORMATS` knows all of them, and tells a file's format by its content. A reader believes nothing
that the log says of itself: what cannot be read is left out and said in `RawLog.lost`, rows that cannot be
true stay where they are and are marked (``use``, ``why``).
"""
