"""What reports say in sentences and tables, one file for each study."""
