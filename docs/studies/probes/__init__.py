"""The probes: drives on the truth that say whether each is just safe, and a picture of each."""
