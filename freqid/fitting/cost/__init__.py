"""The cost: experiments as residuals, structures as unknowns, and everything at a trial point.

It may import what stands below fitting.
"""
