"""What a flight is: a folder with manifest and tables; import from raw files, checks, public data."""
