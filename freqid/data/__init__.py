"""Data: records, frequency responses and their files, bands, and whether samples can be trusted.

It may import what stands below it: checks and lti.
"""
