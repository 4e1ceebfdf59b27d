"""What only makes pages of the documentation; nothing else may import it.

In: catalogues, committed results. Out: pages under `docs/` with tables and figures, and the results that the page of
the comparison shows, by `PYTHONPATH=docs python -m studies NAME`. `page` has the frame that all pages share. May import
everything.
"""
