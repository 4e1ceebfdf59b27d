"""What a comparison shows: tables for the terminal, figures, logs of chosen runs, one HTML page.

In: `Results` and their statistics. Out: files in the folder of the comparison. May import matplotlib, jinja2, rich.
"""
