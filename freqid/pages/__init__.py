"""Pages for a browser: a report on one estimate, and an explorer with sliders.

They may import all packages but ``paper`` and ``cli``.
"""
