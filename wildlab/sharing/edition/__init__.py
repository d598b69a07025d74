"""The partner edition: one flight on one A4 page, in plain words, for somebody who writes no programs."""
