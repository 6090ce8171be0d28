"""The benchmark: what a method achieves on suites, as rows that anybody can play again; rows as data, playing, verification.

Only ``trained`` imports torch, so that rows are read and verified without it.
"""
