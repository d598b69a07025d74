"""One file per log format that is neither a plain table nor MATLAB's: bytes in, columns out.

A reader takes the path (for messages only), the file's bytes and the part that is wanted, and gives columns
by name, (N,) each, in the log's own units and frames, with the line or entry (N,) each row came from; the
recipe says what the units are. It raises `wildlab.errors.WildlabError` with the place where the log is not
what it should be, and believes nothing that the log says of itself.
"""
