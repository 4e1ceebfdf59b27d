"""What only makes pages of the documentation; nothing else may import it.

In: catalogues, committed results. Out: pages under `docs/` with tables and figures, each by a command of its own
(`make family`, `make modes`, ...). May import everything.
"""
