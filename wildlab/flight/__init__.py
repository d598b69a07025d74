"""What a flight is: a folder with a manifest and tables; its import from raw files, its checks, public data."""
