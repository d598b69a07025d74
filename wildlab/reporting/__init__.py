"""From numbers to one offline page: report, figures, metrics, and the ledger. It starts no process."""
