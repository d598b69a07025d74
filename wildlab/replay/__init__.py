"""A flight played back: `scene` takes what is shown from a flight, `page` writes it for any browser."""
