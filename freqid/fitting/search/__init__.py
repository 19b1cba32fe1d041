"""The search: down to a minimum, where to begin, and when enough was found.

It may import fitting.cost.
"""
