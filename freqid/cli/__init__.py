"""The command line: commands, their options, and what they print and write.

It may import every other package, and none may import it.
"""
