"""Whatever is neither a plain table nor MATLAB's: a room for each family of formats, bytes in, columns out.

Raw logs, images, marks and clicks give a `RawLog` (`logs.log`): ``ardupilot``, ``mavlink``, ``px4``, ``dji``,
``tracks``, ``photos``, ``marks``, ``clicks``. The others take the path (for messages only), the file's bytes
and the part that is wanted, and give columns by name, (N,) each, in the log's own units and frames, with the
line or entry (N,) each row came from; the recipe says what the units are. All raise
`wildlab.errors.WildlabError` with the place where a file is not what it should be, and believe nothing that
it says of itself.
"""
