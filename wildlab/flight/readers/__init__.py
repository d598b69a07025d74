"""One file per log format that is neither a plain table nor MATLAB's: bytes in, columns out."""
