"""Commands of the command line, a file for each job, and the options that they share."""
