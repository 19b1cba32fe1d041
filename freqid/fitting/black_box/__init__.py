"""Fits of black boxes: subspaces, rational functions on the lines, charts of state spaces.

It may import the rest of fitting but grey_box, hold_tests, order_selection and entry.
"""
