"""Pictures with matplotlib; what they draw is computed apart, so that plotly can draw it too.

It may import all packages but ``paper``, ``pages`` and ``cli``.
"""
