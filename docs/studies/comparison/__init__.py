"""The page docs/comparison.md: the committed results of the comparison of record and of the reproductions."""
