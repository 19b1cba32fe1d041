"""Responses estimated without a model: ratios of DFTs, averages, local models, periodic data.

It may import what stands below it: checks, lti, data, excitation and models.
"""
