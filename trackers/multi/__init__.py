"""Many objects over any single-object filter."""
