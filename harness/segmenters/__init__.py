"""Segmenters from outside: adapters that satisfy `harness.native.SegmenterFunction`."""
