"""What runs when, and what a run leaves behind: the catalogue of studies, processes, kept seeds, provenance.

It runs what the protocol of `wildlab.studies` offers, and names no case.
"""
