"""What all readers of raw logs share: the parts that they give, order of stamps, places that can be.

Each family of formats has a room of its own beside this one: bytes in, a `RawLog` of named parts out, with
the same columns and units (`log.PARTS`) whatever the format calls them. `formats.FORMATS` knows all readers,
and tells a file's format by its content. A reader believes nothing that the log says of itself: what cannot
be read is left out and said in `RawLog.lost`, rows that cannot be true stay where they are and are marked
(``use``, ``why``).
"""
