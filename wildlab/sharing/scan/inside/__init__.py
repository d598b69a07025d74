"""What is inside of files: one file per family of formats."""
