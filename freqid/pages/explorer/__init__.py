"""The explorer: what a link says, what is drawn of it, and the page that serves it.

It may import all packages but ``paper`` and ``cli``, and nothing of the report.
"""
