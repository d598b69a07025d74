"""From numbers to one offline page: the report, its figures, metrics, and the ledger. It starts no process.

Figures are matplotlib's, apart from pyplot's state; their maps are in metres, east to the right and north up.
Metrics carry their unit beside them (``"m"``, ``"deg"``, ``"1"``), angles in degrees, since people read them.
What is shown is escaped, and a page that could ask the network for something is not written.
"""
