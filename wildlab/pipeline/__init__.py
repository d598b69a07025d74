"""Where flights meet algorithms: flight in, tables out. Thin; what notebooks and commands call."""
