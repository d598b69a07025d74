"""From a notebook to one offline page, the numbers beside it, and the ledger of all studies."""
