"""How drivers drive, of two recorded freeways and of a population: the fit of `scenarios.drivers`."""
