"""ULog of PX4, with names of fields old and new."""
