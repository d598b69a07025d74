"""Points marked in images by hand, on a local page: the page, the server behind it, the file it writes."""
