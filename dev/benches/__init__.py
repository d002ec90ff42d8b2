"""Benchmarks: ratios of times, and counts of instructions."""
