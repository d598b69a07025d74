"""Copies of reports that are safe to send: what is generalised, drawn again, packed and looked through."""
