"""The report: an estimate's figures and sentences, put into one HTML page.

It may import all packages but ``paper`` and ``cli``, and nothing of the explorer.
"""
