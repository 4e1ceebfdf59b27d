"""A run as one page for a browser: everything is in the file, nothing is loaded from elsewhere.

In: a review log. Out: an HTML page with an animation from above, curves, the worst moments, events and objects.
"""
