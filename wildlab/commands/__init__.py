"""Commands of the command line that are about studies, and what all commands share."""
