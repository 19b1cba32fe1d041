"""Excitation: input signals, and the spectra that say where their energy lies.

It may import what stands below it: checks, lti and data.
"""
