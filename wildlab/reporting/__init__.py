"""From numbers to one offline page: the report, its figures, metrics, and the ledger. It starts no process."""
