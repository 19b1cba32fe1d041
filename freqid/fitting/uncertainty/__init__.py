"""How an estimate scatters: the minimum and its covariance, modes, profiles, the noise left.

It may import fitting.cost and fitting.search.
"""
