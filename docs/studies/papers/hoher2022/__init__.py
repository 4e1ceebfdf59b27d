"""Hoher et al. (2022): virtual measurements on a random matrix; a vehicle that turns back and passes."""
