"""The rigs of the catalogue: where their figures come from, what they see, and what tracking makes of other figures."""
